"""Recordings of a cell that is not of this project's model, in the manner of a cycler.

PyBaMM's single-particle model with electrolyte gives voltage and heat, and a radial heat equation
of 25 rings the surface: porous electrodes, diffusion and Butler-Volmer kinetics instead of a table
and branches, a profile of temperatures instead of two masses. Parameters: Ai et al. 2020, as PyBaMM
has them, a lithium cobalt oxide cell of 2.28 Ah nominal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

AMBIENT_K = 296.15
CAPACITY_AH = 2.28
LOW_V, HIGH_V = 3.0, 4.2
_RADIUS_M, _LENGTH_M, _MASS_KG = 9e-3, 65e-3, 0.045
_CONDUCTIVITY_W_PER_M_K, _SPECIFIC_HEAT_J_PER_KG_K = 0.8, 1000.0
_TO_AMBIENT_K_PER_W = 20.0
_RINGS = 25
_PULSES = (
    "Discharge at 1C for 9 minutes",
    "Rest for 15 minutes",
    "Discharge at 2C for 10 seconds",
    "Rest for 60 seconds",
    "Charge at 1C for 10 seconds",
    "Rest for 60 seconds",
) * 6


def recordings(folder: Path) -> dict[str, Path]:
    """Files by name: discharges at three rates, pulses at two temperatures, a charge at C/2."""
    down, rest = f"until {LOW_V} V", "Rest for 40 minutes"
    tests = {
        "slow": ((f"Discharge at C/10 {down}", rest), 1.0, AMBIENT_K, 30.0),
        "1c": ((f"Discharge at 1C {down}", rest), 1.0, AMBIENT_K, 5.0),
        "2c": ((f"Discharge at 2C {down}", rest), 1.0, AMBIENT_K, 2.0),
        "pulses 20 degC": (_PULSES, 0.97, 293.15, 1.0),
        "pulses 40 degC": (_PULSES, 0.97, 313.15, 1.0),
        "charge": (
            (f"Charge at C/2 until {HIGH_V} V", f"Hold at {HIGH_V} V until C/20", rest),
            0.0,
            AMBIENT_K,
            10.0,
        ),
    }
    random = np.random.default_rng(7)
    return {
        name: _written(folder / f"{name}.csv", _recording(*test), test[2], random)
        for name, test in tests.items()
    }


def _recording(
    steps: tuple[str, ...], soc: float, ambient_K: float, period_s: float
) -> tuple[np.ndarray, ...]:
    """Time, current (discharge positive), voltage and heat of a test."""
    import pybamm  # noqa: PLC0415

    parameters = pybamm.ParameterValues("Ai2020")
    parameters["Ambient temperature [K]"] = parameters["Initial temperature [K]"] = ambient_K
    simulation = pybamm.Simulation(
        pybamm.lithium_ion.SPMe({"thermal": "lumped"}),
        experiment=pybamm.Experiment(list(steps), period=f"{period_s:g} seconds"),
        parameter_values=parameters,
    )
    solution = simulation.solve(initial_soc=soc)
    names = ("Time [s]", "Current [A]", "Terminal voltage [V]", "Total heating [W]")
    time_s, *others = (solution[name].entries for name in names)
    new = np.append(True, np.diff(time_s) > 1e-6)
    return time_s[new], *(values[new] for values in others)


def surface_K(time_s: np.ndarray, heat_W: np.ndarray, ambient_K: float) -> np.ndarray:
    """Surface of a cylinder that is heated evenly, by finite volumes and implicit Euler."""
    radius_m = np.linspace(0.0, _RADIUS_M, _RINGS + 1)
    share = np.diff(radius_m**2) / _RADIUS_M**2
    capacity_J_per_K = _MASS_KG * _SPECIFIC_HEAT_J_PER_KG_K * share
    per_m = 2.0 * np.pi * _LENGTH_M * _CONDUCTIVITY_W_PER_M_K / (radius_m[1] - radius_m[0])
    between_W_per_K = per_m * radius_m[1:-1]
    out_W_per_K = 1.0 / (0.5 / (per_m * _RADIUS_M) + _TO_AMBIENT_K_PER_W)
    flows = np.zeros((_RINGS, _RINGS))
    for ring, flow in enumerate(between_W_per_K):
        flows[ring : ring + 2, ring : ring + 2] += flow * np.array([[-1.0, 1.0], [1.0, -1.0]])
    flows[-1, -1] -= out_W_per_K
    rings_K, surface = np.full(_RINGS, ambient_K), [ambient_K]
    for step_s, heat in zip(np.diff(time_s), heat_W[1:]):
        gained = heat * share + capacity_J_per_K / step_s * rings_K
        gained[-1] += out_W_per_K * ambient_K
        rings_K = np.linalg.solve(np.diag(capacity_J_per_K / step_s) - flows, gained)
        flow_W = out_W_per_K * (rings_K[-1] - ambient_K)
        surface.append(ambient_K + _TO_AMBIENT_K_PER_W * flow_W)
    return np.array(surface)


def _written(
    path: Path, recording: tuple[np.ndarray, ...], ambient_K: float, random: np.random.Generator
) -> Path:
    time_s, current_A, voltage_V, heat_W = recording
    noise = random.normal(size=(3, len(time_s))) * np.array([[3e-4], [0.03], [0.03]])
    surface = surface_K(time_s, heat_W, ambient_K) - 273.15 + noise[1]
    columns = (time_s, -current_A, voltage_V + noise[0], surface, ambient_K - 273.15 + noise[2])
    lines = "\n".join(",".join(f"{value:.4f}" for value in row) for row in zip(*columns))
    path.write_text(lines + "\n", encoding="utf-8-sig")
    return path
