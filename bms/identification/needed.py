"""The preset's uncertainty that a recording needs, with assumed and with measured heat."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context

from bms.arrays import Array
from bms.cell import CellParameters
from bms.data.measurements import Measurements
from bms.errors import InputError
from bms.identification.disturbance import ACCURACY_K, MissingRate, missing_rates
from bms.identification.disturbance_bound import DisturbanceBound, disturbance_bound
from bms.identification.heat import assumed_heat_W, fitted_to_heat, measured_heat_W
from bms.presets.schema import Uncertainty

ASSUMED, MEASURED, REFITTED, SURFACE, COOLANT = (
    "core, assumed heat",
    "core, measured heat",
    "core, measured heat and cell fitted to it",
    "surface",
    "coolant",
)
_UP = Context(prec=3, rounding=ROUND_CEILING)


@dataclass(frozen=True)
class Needed:
    """One disturbance that the data need: bound, and how the model then follows the data."""

    bound: DisturbanceBound
    missing: MissingRate


@dataclass(frozen=True)
class NeededUncertainty:
    """Disturbances by name, and the reasons by name of those that the data do not tell."""

    accuracy_K: float
    disturbances: Mapping[str, Needed]
    untold: Mapping[str, str]


def needed_uncertainty(
    cell: CellParameters,
    recording: Measurements,
    voltage_V: Array | None,
    accuracy_K: float = ACCURACY_K,
) -> NeededUncertainty:
    """Disturbances of core, surface and coolant that the cell needs to follow a recording.

    That of the core three times: with heat R0 u^2 - E Tc u; with the heat that the measured voltage
    (N,) tells; and with this heat and the thermal parameters fitted to it. Surface and coolant see
    no heat of their own. InputError for a recording of fewer rows than a bound needs.
    """

    def needed(missing: MissingRate, *, grows: bool = False) -> Needed:
        bound = disturbance_bound(missing.rate_K_per_s, recording.current_A, grows=grows)
        return Needed(bound, missing)

    rates = missing_rates(cell, recording, assumed_heat_W(cell, recording), accuracy_K)
    found = {ASSUMED: needed(rates.core, grows=True)}
    untold = {}
    try:
        if voltage_V is None:
            raise InputError("no column voltage_V with a number in each row")
        heat_W = measured_heat_W(cell, recording, voltage_V)
    except InputError as error:
        untold[MEASURED] = str(error)
    else:
        refitted = fitted_to_heat(cell, recording, heat_W)
        for name, its in ((MEASURED, cell), (REFITTED, refitted)):
            core = missing_rates(its, recording, heat_W, accuracy_K).core
            found[name] = needed(core, grows=True)
    found[SURFACE] = needed(rates.surface)
    if rates.coolant is None:
        untold[COOLANT] = "cooling_power_W is 0 throughout, so something unrecorded cooled it"
    else:
        found[COOLANT] = needed(rates.coolant)
    return NeededUncertainty(accuracy_K, found, untold)


def source_of_core(needed: NeededUncertainty, *, is_family: bool) -> str:
    """Name of the core's disturbance that a preset states.

    The firmware measures the heat of a family, and assumes that of a single cell.
    """
    return MEASURED if is_family and MEASURED in needed.disturbances else ASSUMED


def stated(start: Uncertainty, needed: NeededUncertainty, *, is_family: bool) -> Uncertainty:
    """The uncertainty with the conformal bounds, rounded up; what is untold stays."""
    core = needed.disturbances[source_of_core(needed, is_family=is_family)].bound.conformal
    surface = needed.disturbances[SURFACE].bound.conformal
    changed = dataclasses.replace(
        start,
        core_K_per_s=_up(core.constant_K_per_s),
        core_K_per_As=_up(core.per_A_K_per_As),
        core_K_per_A2s=_up(core.per_A2_K_per_A2s),
        surface_K_per_s=_up(surface.constant_K_per_s),
    )
    if COOLANT not in needed.disturbances:
        return changed
    coolant = needed.disturbances[COOLANT].bound.conformal
    return dataclasses.replace(changed, coolant_K_per_s=_up(coolant.constant_K_per_s))


def _up(value: float) -> float:
    return float(_UP.create_decimal_from_float(value))
