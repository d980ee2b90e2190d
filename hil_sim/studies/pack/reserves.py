"""What a pack's constants have to hold in reserve for cells that differ from the preset's.

docs/pack.md has the derivation of each.
"""

from __future__ import annotations

from dataclasses import dataclass

from bms.barrier import barrier_constants
from bms.barrier.margins import sampling_margins
from bms.barrier.surface_prediction import surface_prediction
from bms.bus_signals import BUS
from bms.cell import CellFactors, CellParameters, scaled
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.studies.pack.coupling import (
    coupling_K_per_s,
    falling_K_per_s,
    greatest_heat_W,
    neighbour_gap_K,
)
from hil_sim.studies.pack.prediction import core_differences, surface_differences
from hil_sim.studies.pack.spread import Spread, Surroundings

ESTIMATE_ERROR_K = 10.0
"""Error of the core's estimate, beyond its bound, that the reversible heat is reserved for: the
estimator knows the preset's cell only."""


@dataclass(frozen=True)
class Reserves:
    """Constants for a pack: changes of the calibration, and what a cell without thermistor needs.

    `bare` has the members of pack_bare_t. A cell that stays cooler than the nominal one by
    `deficit_K` has no broken thermistor.
    """

    changes: dict[str, float]
    bare: dict[str, float]
    deficit_K: float = 0.0


NO_RESERVES = Reserves({}, {})


def reserves(preset: Preset, spread: Spread, around: Surroundings) -> Reserves:
    """Constants that are sufficient for every cell of the spread.

    A preset that states a family needs none, since its own intervals hold. Raises InputError for
    gains that make the core's condition depend on the estimate: then its power form is not the one
    that is invariant over the spread.
    """
    if preset.cell.interval is not None:
        return NO_RESERVES
    gain_per_s = preset.gains.core_gain_per_s(preset.cell)
    nominal = barrier_constants(preset.cell, preset)
    if abs(gain_per_s - nominal.a1_per_s) > 1e-6 * nominal.a1_per_s:
        raise InputError(
            f"preset '{preset.name}': gains.alpha2_per_s is not 1/(Rc Cc), so that no interval of "
            "Rc is proven; leave it out, or choose paper_calibrated or a preset with intervals"
        )
    worst = scaled(
        preset.cell,
        CellFactors(
            core_resistance=spread.core_resistance[1],
            core_heat_capacity=spread.core_heat_capacity[1],
            resistance=spread.resistance[1],
            capacity=spread.capacity[0],
        ),
    )
    return Reserves(
        changes=_changes(preset, worst, spread, around),
        bare=_bare(preset, spread, around),
        deficit_K=_deficit_K(preset, spread, around),
    )


def _changes(
    preset: Preset, worst: CellParameters, spread: Spread, around: Surroundings
) -> dict[str, float]:
    """The core's and the voltage's condition of the worst cell, charge of the smallest."""
    own = barrier_constants(worst, preset)
    hold_s = preset.timing.sampling_period_s + preset.timing.delay_s
    margins = [sampling_margins(cell, preset) for cell in _extremes(preset, spread)]
    estimate_K_per_s = abs(own.a2_per_As) * -preset.limits.reference_current_A * ESTIMATE_ERROR_K
    return {
        "capacity_As": worst.capacity_As,
        "ohmic_resistance_ohm": worst.ohmic_resistance_ohm,
        "a1_per_s": own.a1_per_s,
        "alpha2_per_s": own.a1_per_s,
        "a2_per_As": own.a2_per_As,
        "a3_K_per_A2s": own.a3_K_per_A2s,
        "voltage_margin_V": max(float(margin.voltage_V) for margin in margins),
        "soc_margin_per_s": max(float(margin.soc_per_s) for margin in margins),
        "core_margin_K_per_s": max(float(margin.core_K_per_s) for margin in margins)
        + own.a1_per_s * hold_s * coupling_K_per_s(preset, spread, around)
        + estimate_K_per_s,
    }


def _extremes(preset: Preset, spread: Spread) -> list[CellParameters]:
    """Cells at all corners, each with the greatest resistance and the least capacity."""
    most = CellFactors(resistance=spread.resistance[1], capacity=spread.capacity[0])
    return [scaled(corner, most) for corner in spread.corners(preset.cell)]


def _bare(preset: Preset, spread: Spread, around: Surroundings) -> dict[str, float]:
    cell, sensors = preset.cell, preset.sensors
    most_W = greatest_heat_W(preset, spread)
    surface, core = surface_differences(preset, spread), core_differences(preset, spread)
    surface_K = (
        surface_prediction(cell, preset).error_bound_K
        + _neighbours_K(preset, spread, around)
        + surface.falling_K_per_K_per_s * falling_K_per_s(preset)
    )
    core_K = surface_K + (surface.above_K_per_W + core.above_K_per_W + core.below_K_per_W) * most_W
    strength_A = -preset.limits.reference_current_A
    entropic = abs(cell.entropic_coefficient_V_per_K)
    rc = cell.core_resistance_K_per_W * spread.core_resistance[1]
    return {
        "resistance_factor": spread.resistance[1],
        # What the smallest cell is ahead of the largest when it is full.
        "soc_error": 1.0 - spread.capacity[0] / spread.capacity[1],
        "voltage_error_V": sensors.voltage_V.error_bound + BUS.voltage_V,
        "current_error_A": sensors.current_A.error_bound + BUS.current_A,
        "surface_K": surface_K,
        "surface_K_per_W": surface.above_K_per_W,
        "estimate_K": rc * entropic * strength_A * core_K,
    }


def _deficit_K(preset: Preset, spread: Spread, around: Surroundings) -> float:
    """By how much the surface of a cell can be below the prediction from the nominal resistance."""
    most_W = greatest_heat_W(preset, spread)
    less_W = (1.0 - spread.resistance[0]) * most_W
    surface = surface_differences(preset, spread)
    return (
        surface.below_K_per_W * most_W
        + surface.falling_K_per_K_per_s * falling_K_per_s(preset)
        + preset.cell.surface_resistance_K_per_W * less_W
        + _neighbours_K(preset, spread, around)
    )


def _neighbours_K(preset: Preset, spread: Spread, around: Surroundings) -> float:
    """What two neighbours, and a coolant that is not as warm as it seems, do to a surface.

    The coolant is taken to be uneven by all that one cell's heat makes of it.
    """
    slowest = preset.cell.surface_resistance_K_per_W * spread.surface_resistance[1]
    neighbours_W = 2.0 * around.neighbour_W_per_K * neighbour_gap_K(preset, spread, around)
    return slowest * neighbours_W + greatest_heat_W(preset, spread) / around.flow_W_per_K
