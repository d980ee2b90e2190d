"""What the constants of a family have to be, from the preset's intervals and the cell model.

Each relation is what a step of the argument in docs/family.md takes for granted. The constants are
those of the firmware's own calibration block, in float32; what they are held to is worked out here
in another way than bms/barrier/family.py does, by trying the corners and fine grids of the model.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import expm

from bms.barrier.readings import reading_errors
from bms.bus_signals import BUS
from bms.cell import CellParameters
from bms.cell.model import ohmic_resistance_ohm
from bms.presets import Preset

OVERFULL_SOC = 1.005
"""No cell of the family is charged beyond this."""
_FINE = 2001
_STEP_S, _LONGEST_S = 0.05, 2000.0


@dataclass(frozen=True)
class Relation:
    """One thing that the argument needs: `has` is not to be below `needs`; the worst state."""

    name: str
    needs: float
    has: float
    state: Mapping[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether it is so; what is no number is not."""
        return bool(self.has >= self.needs)


def relations(preset: Preset, block: Any) -> list[Relation]:
    """Everything that is needed of the constants, for the block of a preset with a family."""
    return [
        *_charge(preset, block.family),
        *_resistance(preset, block.family),
        *_core(preset, block.family),
        *_readings(preset, block.family),
        *_ends(preset, block),
    ]


def corners(preset: Preset) -> Iterator[dict[str, float]]:
    """Thermal parameters at every corner of the intervals."""
    interval = preset.cell.interval
    assert interval is not None
    nominal = {
        "core_resistance": preset.cell.core_resistance_K_per_W,
        "core_heat_capacity": preset.cell.core_heat_capacity_J_per_K,
        "surface_resistance": preset.cell.surface_resistance_K_per_W,
        "surface_heat_capacity": preset.cell.surface_heat_capacity_J_per_K,
        "coolant_heat_capacity": preset.cell.coolant_heat_capacity_J_per_K,
    }
    for factors in itertools.product(*(getattr(interval, name) for name in nominal)):
        yield {name: value * factor for (name, value), factor in zip(nominal.items(), factors)}


def _charge(preset: Preset, k: Any) -> Iterator[Relation]:
    cell, interval = preset.cell, preset.cell.interval
    assert interval is not None
    period_s = preset.timing.sampling_period_s
    least_As, most_As = (cell.capacity_As * factor for factor in interval.capacity)
    yield Relation("charge is counted up fast enough", period_s / least_As, k.greatest_soc_per_A)
    yield Relation("charge is counted down slowly enough", k.least_soc_per_A, period_s / most_As)
    yield Relation("plug-in error", preset.plug_in.soc_error, k.plug_in_error)
    hold_s = period_s + preset.timing.delay_s + preset.supply.lag_s
    yield Relation("hold", hold_s * (1.0 - 1e-6), k.hold_s)
    yield Relation("charge of a hold", hold_s / least_As, k.hold_soc_per_A)
    soc = np.linspace(0.0, 1.0, _FINE)
    slopes = np.diff(cell.ocv(soc)) / np.diff(soc)
    middles = 0.5 * (soc[1:] + soc[:-1])
    yield _table("slope of the open-circuit voltage", "soc", middles, slopes, k.ocv_slope_V)
    yield Relation(
        "slope beyond full", cell.ocv.overfill_slope_V, k.ocv_slope_V[len(k.ocv_slope_V) - 1]
    )
    entropic = (
        np.full_like(soc, cell.entropic_coefficient_V_per_K)
        if cell.entropy is None
        else np.asarray(cell.entropy(soc))
    )
    yield _table(
        "dU/dT", "soc", soc, entropic + interval.entropic_error_V_per_K, k.entropic_V_per_K
    )


def _table(name: str, axis: str, at: Any, needed: Any, cells: Any) -> Relation:
    """The point of a table by cells from 0 to 1 that is nearest to what is needed there."""
    values = np.array(list(cells))
    index = np.minimum((np.clip(at, 0.0, 1.0) * len(values)).astype(int), len(values) - 1)
    worst = int(np.argmin(values[index] - needed))
    has, needs = float(values[index][worst]), float(needed[worst])
    return Relation(name, needs - 1e-9 * abs(needs), has, {axis: float(at[worst])})


def _resistance(preset: Preset, k: Any) -> Iterator[Relation]:
    cell, interval = preset.cell, preset.cell.interval
    assert interval is not None
    nodes = np.array(list(k.resistance_ohm))
    grid_K = k.coldest_K + np.arange(len(nodes)) / k.per_step_K
    low_K = preset.operating_box.surface_temperature_K[0]
    high_K = preset.limits.max_core_temperature_K
    points_K = () if cell.resistance is None else cell.resistance.temperature_K
    kinks_K = [point for point in points_K if low_K <= point <= high_K]
    temperature_K = np.sort(np.concatenate([np.linspace(low_K, high_K, _FINE), kinks_K]))
    soc = (0.0,) if cell.resistance is None else cell.resistance.soc
    ohm = np.array([_ohm(cell, temperature_K, charge) for charge in soc])
    warmest = np.maximum.accumulate(ohm.max(axis=0)[::-1])[::-1] * interval.resistance[1]
    has = np.interp(temperature_K, grid_K, nodes)
    worst = int(np.argmin(has - warmest))
    yield Relation(
        "greatest resistance at and above a temperature",
        float(warmest[worst]),
        float(has[worst]),
        {"surface_K": float(temperature_K[worst])},
    )
    yield Relation(
        "least resistance", k.least_resistance_ohm, float(ohm.min()) * interval.resistance[0]
    )
    together = sum(branch.resistance_ohm for branch in cell.branches) * interval.polarisation[1]
    yield Relation("resistance of the branches", together, k.polarisation_ohm)
    period_s = preset.timing.sampling_period_s
    yield Relation(
        "what is left of a polarisation",
        float(np.exp(-period_s / interval.longest_relaxation_s)) * (1.0 - 1e-6),
        k.relaxation,
    )
    yield Relation(
        "polarisation at plug-in", preset.plug_in.polarisation_V - 1e-7, k.rest_polarisation_V
    )
    for branch, bound in zip(cell.branches, k.branch):
        drift = interval.polarisation[1] * branch.resistance_ohm / branch.time_constant_s
        yield Relation("drift of a branch", drift, bound.drift_ohm_per_s)
        branch_ohm = interval.polarisation[1] * branch.resistance_ohm
        yield Relation("resistance of a branch", branch_ohm, bound.resistance_ohm)
        way = -float(np.expm1(-period_s / branch.time_constant_s))
        yield Relation("a branch at its fastest", way, bound.fast)
        yield Relation("a branch at its slowest", bound.slow, way)


def _ohm(cell: CellParameters, temperature_K: Any, soc: float) -> Any:
    values = [float(ohmic_resistance_ohm(cell, float(T), soc)) for T in temperature_K]
    return np.array(values)


def _core(preset: Preset, k: Any) -> Iterator[Relation]:
    """The observer is above the core at every corner, and a hold takes no more than kept."""
    noise, supply = preset.uncertainty, preset.supply
    period_s = preset.timing.sampling_period_s
    strongest_A = -preset.limits.reference_current_A * (1.0 + supply.tolerance)
    capacities = [corner["core_heat_capacity"] for corner in corners(preset)]
    resistances = [corner["core_resistance"] for corner in corners(preset)]
    outflow = min(1.0 / ohm for ohm in resistances)
    yield Relation("outflow of the core", k.outflow_W_per_K, outflow)
    yield Relation("gain of the core", k.outflow_W_per_K * (1.0 - 1e-6), k.gain_W_per_K)
    yield Relation("heating of the core", period_s / min(capacities), k.heating_K_per_W)
    longest = max(resistances)
    slowest = min(
        period_s / capacity / (1.0 + period_s / (capacity * longest)) for capacity in capacities
    )
    yield Relation("cooling of the core", k.cooling_K_per_W, slowest)
    for strength_A in (0.0, 0.5 * strongest_A, strongest_A):
        needs = max(capacities) * float(noise.core_at_K_per_s(strength_A))
        has = k.disturbance_W + strength_A * (
            k.disturbance_W_per_A + strength_A * k.disturbance_W_per_A2
        )
        yield Relation(
            "disturbance of the core", needs * (1.0 - 1e-6), has, {"current_A": -strength_A}
        )
    rise, corner = _fastest_surface_K_per_s(preset, k)
    yield Relation(
        "what a hold takes from the outflow", outflow * k.hold_s * rise, k.hold_W * 1.001, corner
    )
    # Within a hold the room to the limit shrinks by less than itself.
    yield Relation("gain within a hold", k.gain_W_per_K * k.hold_s / min(capacities), 1.0)
    excess_K = max(
        noise.surface_K_per_s
        / (
            1.0 / (corner["core_resistance"] * corner["surface_heat_capacity"])
            + 1.0 / (corner["surface_resistance"] * corner["surface_heat_capacity"])
        )
        for corner in corners(preset)
    )
    above_K = max(
        0.0,
        preset.limits.max_core_temperature_K - preset.limits.max_surface_temperature_K,
    )
    yield Relation("surface above core and coolant", above_K + excess_K, k.inner_K)


def _fastest_surface_K_per_s(preset: Preset, k: Any) -> tuple[float, dict[str, float]]:
    """Largest rise of the surface from rest over all heats, by its response to a step of heat.

    A positive system: the rate's impulse response is integrated where it is positive, numerically.
    """
    from bms.barrier.family import greatest_heat_W  # noqa: PLC0415

    heat_W, noise = greatest_heat_W(preset), preset.uncertainty
    fastest, where = 0.0, {}
    for corner in corners(preset):
        matrix = _thermal_matrix(corner)
        step = expm(matrix * _STEP_S)
        sources = (
            (heat_W + corner["core_heat_capacity"] * noise.core_K_per_s, 0, "core_heat_capacity"),
            (corner["surface_heat_capacity"] * noise.surface_K_per_s, 1, "surface_heat_capacity"),
            (corner["coolant_heat_capacity"] * noise.coolant_K_per_s, 2, "coolant_heat_capacity"),
        )
        rate = 0.0
        for power_W, node, capacity in sources:
            state = np.zeros(3)
            state[node] = 1.0 / corner[capacity]
            # The response starts with the source's own jump, and then is the rate of the surface.
            positive = state[1]
            before = matrix[1] @ state
            for _ in range(int(_LONGEST_S / _STEP_S)):
                state = step @ state
                after = matrix[1] @ state
                positive += 0.5 * _STEP_S * (max(before, 0.0) + max(after, 0.0))
                before = after
                if before < 0.0 and node == 0:
                    break
                if state[1] < 1e-9 and node != 0:
                    break
            rate += power_W * positive
        if rate > fastest:
            fastest, where = rate, corner
    return fastest, where


def _thermal_matrix(corner: Mapping[str, float]) -> Any:
    core_W, coolant_W = 1.0 / corner["core_resistance"], 1.0 / corner["surface_resistance"]
    flows = np.array(
        [
            [-core_W, core_W, 0.0],
            [core_W, -core_W - coolant_W, coolant_W],
            [0.0, coolant_W, -coolant_W],
        ]
    )
    capacities = [
        corner["core_heat_capacity"],
        corner["surface_heat_capacity"],
        corner["coolant_heat_capacity"],
    ]
    return flows / np.array(capacities)[:, None]


def _readings(preset: Preset, k: Any) -> Iterator[Relation]:
    errors, sensors = reading_errors(preset), preset.sensors
    yield Relation(
        "error of the current",
        (sensors.current_A.error_bound + BUS.current_A) * (1.0 - 1e-6),
        k.current_error_A,
    )
    yield Relation(
        "error of the voltage",
        (sensors.voltage_V.error_bound + BUS.voltage_V) * (1.0 - 1e-6),
        k.voltage_error_V,
    )
    yield Relation("error of the surface", errors.surface_K * (1.0 - 1e-6), k.surface_error_K)
    yield Relation("error of the coolant", errors.coolant_K * (1.0 - 1e-6), k.coolant_error_K)
    yield Relation("tolerance of the charger", preset.supply.tolerance - 1e-7, k.supply_tolerance)


def _ends(preset: Preset, block: Any) -> Iterator[Relation]:
    """Neither too full by the voltage limit, nor complete too early by what proves a full cell."""
    cell, interval, limits = preset.cell, preset.cell.interval, preset.limits
    assert interval is not None
    overfull_V = float(cell.ocv(OVERFULL_SOC)) - interval.ocv_error_V
    yield Relation(
        "a cell at the voltage limit is not overfull",
        block.rcbf.max_voltage_V,
        overfull_V,
        {"soc": OVERFULL_SOC},
    )
    yield Relation(
        "a cell taken for full is full",
        float(cell.ocv(limits.completion_soc)) - 1e-6,
        block.family.full_ocv_V,
        {"soc": limits.completion_soc},
    )
