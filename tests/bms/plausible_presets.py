"""Presets of cells that could be bought: three by hand, and as many as hypothesis draws."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

from hypothesis import strategies as st

from bms.bus_signals import RANGES
from bms.cell import CellParameters, OpenCircuitVoltage
from bms.model.model_file import KanModel, load_shipped_model
from bms.presets import Preset, load_preset
from bms.presets.schema import (
    Gains,
    Initial,
    Limits,
    OperatingBox,
    Sensor,
    Sensors,
    Timing,
    Uncertainty,
)

CURVES = {
    "lfp": (
        (0.0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.7, 0.95, 0.98, 1.0),
        (2.50, 2.70, 3.00, 3.18, 3.24, 3.29, 3.32, 3.35, 3.40, 3.55),
    ),
    "nmc": (
        (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
        (2.90, 3.15, 3.30, 3.43, 3.52, 3.58, 3.63, 3.69, 3.78, 3.88, 3.98, 4.08, 4.19),
    ),
    "lto": (
        (0.0, 0.03, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0),
        (1.90, 2.10, 2.15, 2.22, 2.28, 2.34, 2.43, 2.55, 2.70),
    ),
}
"""State of charge and open-circuit voltage (V), as data sheets draw them."""


def model_for(preset: Preset, error_bound_K: float = 0.4, shipped: str = "lin2014") -> KanModel:
    """A shipped network in the place of one trained for the preset.

    Only its error bound counts, and that it knows the state in which the preset's charge begins.
    """
    return replace(
        _shipped(shipped),
        training_hash=preset.training_hash,
        error_bound_K=error_bound_K,
        error_bound_parts_K={"estimate": error_bound_K},
        error_bounds=None,
    )


@cache
def _shipped(name: str) -> KanModel:
    return load_shipped_model(name)


def other_cells() -> dict[str, Preset]:
    """An 18650 of 3 Ah at 4.2 V, a 26650 of 3.8 Ah at 3.65 V and a pouch of 20 Ah at 4.2 V."""
    nmc, lfp = OpenCircuitVoltage(*CURVES["nmc"]), OpenCircuitVoltage(*CURVES["lfp"])
    return {
        "nmc_18650": _changed(
            CellParameters(3.0, 3.3, 38.0, 6.5, 3.2, 60.0, 0.028, -1.0e-4, nmc),
            4.2, 0.98, -6.0, 318.0,
        ),
        "lfp_26650": _changed(
            CellParameters(3.8, 1.9, 75.0, 3.2, 5.0, 100.0, 0.009, -5.0e-5, lfp),
            3.65, 0.995, -15.2, 323.0,
        ),
        "nmc_pouch": _changed(
            CellParameters(20.0, 0.4, 380.0, 0.6, 40.0, 500.0, 0.0028, 8.0e-5, nmc),
            4.2, 0.98, -40.0, 318.0,
        ),
    }  # fmt: skip


def _changed(
    cell: CellParameters,
    max_voltage_V: float,
    completion_soc: float,
    current_A: float,
    limit_K: float,
) -> Preset:
    base = load_preset("lin2014")
    return replace(
        base,
        name="other",
        cell=cell,
        limits=replace(
            base.limits,
            max_voltage_V=max_voltage_V,
            max_core_temperature_K=limit_K,
            max_surface_temperature_K=limit_K,
            reference_current_A=current_A,
            current_growth_A_per_s=-0.1 * current_A,
            completion_soc=completion_soc,
        ),
        operating_box=OperatingBox(
            (1.05 * current_A, -0.02 * current_A),
            (0.0, 3.0),
            (283.0, limit_K + 3.0),
            (275.0, limit_K + 1.0),
        ),
    )


def _between(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers from low to high, each factor of ten as likely as another."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def _sensors(capacity_Ah: float) -> st.SearchStrategy[Sensors]:
    def sensor(resolution: float, noise: float, bias: float) -> st.SearchStrategy[Sensor]:
        biases = st.sampled_from([0.0, -bias, bias])
        return st.builds(
            Sensor, _between(0.05 * resolution, resolution), st.floats(0, noise), biases
        )

    return st.builds(
        Sensors,
        sensor(0.02 * math.sqrt(capacity_Ah), 0.02, 0.01),
        sensor(5e-3, 5e-3, 1e-3),
        sensor(0.3, 0.1, 0.3),
        sensor(0.3, 0.1, 0.3),
        sensor(0.05, 0.02, 0.02),
    )


@st.composite
def plausible_presets(draw: st.DrawFn) -> Preset:
    """Cells of 0.5 to 60 Ah of three chemistries, charged at 0.5C to 10C, with any valid rest.

    Heat capacities, resistances and times as of round and flat cells; limits below and above what
    the open-circuit voltage reaches; completion up to the limit of charge.
    """
    capacity_Ah = draw(_between(0.5, 60.0))
    soc, voltage_V = CURVES[draw(st.sampled_from(sorted(CURVES)))]
    shape = [draw(st.floats(0.0, 4e-3)) for _ in voltage_V]
    ocv = OpenCircuitVoltage(soc, tuple(v + sum(shape[: i + 1]) for i, v in enumerate(voltage_V)))
    core_J_per_K = capacity_Ah * draw(_between(12.0, 30.0))
    cell = CellParameters(
        capacity_Ah,
        draw(_between(0.5, 8.0)) / capacity_Ah**0.6,
        core_J_per_K,
        draw(_between(1.0, 15.0)) / capacity_Ah**0.6,
        core_J_per_K * draw(_between(0.03, 0.5)),
        core_J_per_K * draw(_between(0.3, 10.0)),
        draw(_between(0.015, 0.09)) / capacity_Ah,
        draw(st.floats(-3e-4, 3e-4)),
        ocv,
    )
    current_A = -capacity_Ah * draw(_between(0.5, 10.0))
    max_soc = draw(st.sampled_from([1.0, 0.9, 0.8]) | st.floats(0.7, 1.0))
    core_K = draw(st.floats(313.0, 333.0))
    surface_K = core_K - draw(st.just(0.0) | st.floats(0.0, 5.0))
    coldest_K = draw(st.floats(263.0, 288.0))
    alpha4 = draw(_between(0.1, 2.0))
    first = alpha4 * draw(st.floats(0.02, 0.98))
    bound = _between(5e-5, 5e-3)
    own_gain = 1.0 / (cell.core_resistance_K_per_W * core_J_per_K)
    period_s = draw(st.sampled_from([0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]))
    # A steeper ramp would hide a wrong current, and is refused.
    growth_per_s = draw(_between(0.02, min(1.0, 0.124 / period_s)))
    cooling_W = draw(st.floats(0.2, 1.0)) * cell.ohmic_resistance_ohm * current_A**2
    return Preset(
        "drawn", "", (), cell,
        Limits(
            float(ocv(max_soc)) + draw(st.floats(-0.1, 0.15)),
            max_soc, core_K, surface_K, current_A, -current_A * growth_per_s,
            max_soc * draw(st.sampled_from([1.0, 0.99, 0.9])),
        ),
        Gains(
            draw(_between(0.01, 0.3)), first * (alpha4 - first), alpha4,
            draw(st.none() | st.floats(0.3, 4.0).map(lambda factor: factor * own_gain)),
        ),
        Uncertainty(
            draw(st.just(0.0) | st.floats(0.0, 1e-6)), draw(bound), draw(bound), draw(bound),
            draw(_between(5e-3, 0.3)),
        ),
        Timing(
            period_s,
            draw(st.sampled_from([0.0, 0.05, 0.1, 0.5])),
        ),
        draw(_sensors(capacity_Ah)),
        Initial(0.1, 298.15, 0.0),
        OperatingBox(
            (1.05 * current_A, -0.02 * current_A),
            # What cannot be begins 5 % beyond the box, and has to fit on the signal.
            (0.0, min(cooling_W, 0.95 * RANGES.cooling_power_W[1])),
            (coldest_K, surface_K + 3.0),
            (coldest_K - 8.0, surface_K + 1.0),
        ),
    )  # fmt: skip
