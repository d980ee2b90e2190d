"""Each cell of a spread under the constants of its pack: interval proofs of one decision's hold."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from bms.barrier.margins import decision_allowances
from bms.barrier.readings import reading_errors
from bms.barrier.rounding import ARITHMETIC_ROUNDINGS
from bms.bus_signals import BUS
from bms.cell import CellFactors, CellParameters, scaled
from bms.decision import ConstraintMargins
from bms.presets import Preset
from bms.verification.barriers import Barrier
from bms.verification.certificate import Certificate
from bms.verification.conditions import chains, decided_conditions, required_conditions
from bms.verification.domain import certified_domain
from bms.verification.electrical import certify_soc, certify_voltage
from bms.verification.thermal import Case, certify
from hil_sim.studies.pack.spread import Spread

LARGEST_BOXES = 100_000
_OWN_BOXES = 2000
"""Boxes after which what is left is held by the bound on all histories from rest."""
_NO_SURFACE_LIMIT_K = 500.0
"""Above any operating box: what is shown of the core must not rest on the surface's condition."""


@dataclass(frozen=True)
class CellCase:
    """A cell of a spread, and what its pack decides by.

    `worst` has the greatest resistances and heat capacity and the least charge of the spread.
    `coupling_K_per_s` acts on its surface beside the preset's disturbances, `estimate_error_K` on
    the core's estimate beside its bound.
    """

    preset: Preset
    cell: CellParameters
    worst: CellParameters
    constants: Mapping[str, Any]
    coupling_K_per_s: float
    estimate_error_K: float

    @property
    def own(self) -> Preset:
        """A preset of this very cell, with all that disturbs it."""
        bounds = self.preset.uncertainty
        surface_K_per_s = bounds.surface_K_per_s + self.coupling_K_per_s
        limits = replace(self.preset.limits, max_surface_temperature_K=_NO_SURFACE_LIMIT_K)
        return replace(
            self.preset,
            cell=self.cell,
            limits=limits,
            gains=replace(self.preset.gains, alpha2_per_s=None),
            uncertainty=replace(bounds, surface_K_per_s=surface_K_per_s),
        )


def spread_ends(spread: Spread) -> Iterator[CellFactors]:
    """Every corner of a spread once."""
    intervals = (
        spread.core_resistance,
        spread.core_heat_capacity,
        spread.surface_resistance,
        spread.resistance,
        spread.capacity,
    )
    for rc, cc, rs, resistance, capacity in itertools.product(*map(sorted, map(set, intervals))):
        yield CellFactors(
            core_resistance=rc,
            core_heat_capacity=cc,
            surface_resistance=rs,
            resistance=resistance,
            capacity=capacity,
        )


def worst_cell(cell: CellParameters, spread: Spread) -> CellParameters:
    """The cell that a pack's constants are of."""
    return scaled(
        cell,
        CellFactors(
            core_resistance=spread.core_resistance[1],
            core_heat_capacity=spread.core_heat_capacity[1],
            resistance=spread.resistance[1],
            capacity=spread.capacity[0],
        ),
    )


def certify_core(case: CellCase, largest_boxes: int = LARGEST_BOXES) -> Certificate:
    """Branch and bound for the cell's own core condition, in the unit of the worst cell's.

    Its own condition is that of its heat flows over its heat capacity; over the worst cell's it is
    as sufficient, and equal terms of both cancel.
    """
    own, cell = case.own, case.cell
    share = cell.core_heat_capacity_J_per_K / case.worst.core_heat_capacity_J_per_K
    required = required_conditions(own)[0].times(share)
    decided = decided_conditions(case.constants)[0]
    strongest_A = -own.limits.reference_current_A
    allowance = (
        _allowances(case, case.worst).core_K_per_s
        + abs(case.constants["a2_per_As"]) * strongest_A * case.estimate_error_K
    )
    gain_per_s = own.gains.core_gain_per_s(cell)
    domain = certified_domain(own, required, chains(own)[0])
    core = Case(Barrier.CORE, required, decided, gain_per_s, float(allowance))
    return certify(domain, core, reading_errors(own), largest_boxes, _OWN_BOXES)


def certify_electrical(case: CellCase) -> tuple[Certificate, float, Certificate]:
    """Voltage with the least distance to its limit in V, and state of charge."""
    # The decision rounds as for the worst cell.
    worst, own = _allowances(case, case.worst), _allowances(case, case.cell)
    constants = {
        **case.constants,
        "voltage_margin_V": case.constants["voltage_margin_V"] - (worst.voltage_V - own.voltage_V),
        "soc_margin_per_s": case.constants["soc_margin_per_s"] - (worst.soc_per_s - own.soc_per_s),
    }
    voltage, distance_V = certify_voltage(case.own, constants)
    return voltage, float(distance_V), certify_soc(case.own, constants)


def warmest_coolant_K(preset: Preset, cell: CellParameters) -> float:
    """Coolant up to which no surface gets above its limit where no core is above its own.

    At the hottest surface of a pack neighbours only cool. At its limit it falls if coolant and core
    take away no less than its disturbance brings.
    """
    limits = preset.limits
    beyond_K = max(0.0, limits.max_core_temperature_K - limits.max_surface_temperature_K)
    brought_W = (
        cell.surface_heat_capacity_J_per_K * preset.uncertainty.surface_K_per_s
        + beyond_K / cell.core_resistance_K_per_W
    )
    return limits.max_surface_temperature_K - cell.surface_resistance_K_per_W * brought_W


def covered_coupling_K_per_s(cases: list[CellCase], bound_K_per_s: float, steps: int = 4) -> float:
    """Coupling up to which the core of every one of these cells is certified, by bisection.

    Looked for from the bound, which all of them are certified for, to a quarter more.
    """
    most = 1.25 * bound_K_per_s
    for case in cases:
        if _lasts(case, most):
            continue
        least = bound_K_per_s
        for _ in range(steps):
            middle = 0.5 * (least + most)
            holds = _lasts(case, middle)
            least, most = (middle, most) if holds else (least, middle)
        most = least
    return most


def _lasts(case: CellCase, coupling_K_per_s: float) -> bool:
    return certify_core(replace(case, coupling_K_per_s=coupling_K_per_s), LARGEST_BOXES // 4).holds


def _allowances(case: CellCase, cell: CellParameters) -> ConstraintMargins:
    return decision_allowances(cell, replace(case.own, cell=cell), BUS, ARITHMETIC_ROUNDINGS)
