"""Branch and bound over the thermal domain: which boxes a decision keeps safe until the next one.

For a box of states, currents and cooling power one of these is shown, with intervals rounded
outward:

  excluded   no state of the box is in the domain, or no reading of it admits such a current
  far        the barrier is further from zero than it can move within the held time
  held       the condition G holds long enough: G >= g at the reading and falls no faster than r, so
             the barrier, which obeys b' + lambda b = G, is not negative at any instant of the hold

A box of which none can be shown is halved. At first r is what the box can drift to within the hold.
Where the hold is about as long as the cell's fast mode, that is more than a cell from rest can do;
so after OWN_BOXES the domain's bound on the fall holds r down, too. What is left at the largest
number of boxes is reported with its worst state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.arrays import Array, Mask
from bms.barrier.readings import ReadingErrors
from bms.verification.barriers import Barrier
from bms.verification.boxes import Boxes
from bms.verification.certificate import Certificate, Shortfall
from bms.verification.conditions import Condition, ErrorTerm
from bms.verification.domain import Domain, Point, Rates, weights
from bms.verification.drift import drift_gain_s, held_rates, largest_fall
from bms.verification.intervals import Interval

LARGEST_BATCH = 20_000
OWN_BOXES = 30_000
"""Boxes that are tried with their own drift alone."""


@dataclass(frozen=True)
class Case:
    """One barrier: what has to hold, what is decided by, and the barrier's own decay rate.

    `allowance` is what arithmetic and bus can take from the decided condition, in its unit.
    """

    barrier: Barrier
    required: Condition
    decided: Condition
    decay_per_s: float
    allowance: float


def certify(
    domain: Domain,
    case: Case,
    errors: ReadingErrors,
    largest_boxes: int,
    own_boxes: int = OWN_BOXES,
) -> Certificate:
    """Branch and bound for one barrier; stops undecided at largest_boxes."""
    gain_s = drift_gain_s(domain)
    pending = [Boxes.whole(domain)]
    examined, by_history = 0, False
    while pending and examined < largest_boxes:
        boxes = pending.pop()
        by_history = examined >= own_boxes
        examined += len(boxes)
        missing = _missing(domain, case, errors, boxes, gain_s, by_history)
        # What is no number is not shown.
        undecided = boxes[~(missing <= 0.0)]
        halves = undecided.halved(_scores(domain, case, undecided))
        pending.extend(halves.batches(LARGEST_BATCH))
    left = Boxes.joined(pending)
    if not len(left):
        return Certificate(case.barrier.value, examined, 0, by_history=by_history)
    middle = left.middles()
    missing = _missing(domain, case, errors, middle, gain_s, True)
    worst = int(np.argmax(missing))
    return Certificate(
        case.barrier.value,
        examined,
        len(left),
        Point(*left.low.min(axis=0).tolist()),
        Point(*left.high.max(axis=0).tolist()),
        Shortfall(Point(*middle.low[worst].tolist())._asdict(), float(missing[worst])),
        by_history,
    )


def held_integral(least: Any, fall: Any, decay_per_s: float, begin_s: float, end_s: float) -> Any:
    """Integral of exp(decay s) (least - fall (begin + s)) over s from 0 to end - begin.

    Times exp(-decay (end - begin)) it is what b' + decay b = G adds to b; the integrand falls
    through zero at most once, so that the integral up to any earlier time is not negative either.
    """
    hold_s = end_s - begin_s
    grown = np.expm1(decay_per_s * hold_s) / decay_per_s
    moment = (hold_s * np.exp(decay_per_s * hold_s) - grown) / decay_per_s
    return (least - fall * begin_s) * grown - fall * moment


def _missing(
    domain: Domain, case: Case, errors: ReadingErrors, boxes: Boxes, gain_s: Array, by_history: bool
) -> Array:
    """What each box's condition lacks to last for the hold, in its unit.

    Not positive where it lasts, minus infinity where it need not.
    """
    gain = _reading_gain(case.decided, errors, boxes.current_A)
    rates = held_rates(domain, gain_s, boxes)
    is_far = _core_is_far if case.barrier is Barrier.CORE else _surface_is_far
    needless = _are_excluded(domain, case, boxes, gain) | is_far(domain, boxes, rates)
    missing = _lacking(domain, case, boxes, rates, gain, by_history)
    return np.where(needless, -np.inf, missing)


def _are_excluded(domain: Domain, case: Case, boxes: Boxes, gain: Any) -> Mask:
    """Whether nothing of a box is in the domain, or no reading of it admits such a current.

    `gain` is by how much the condition as decided can exceed that at true values.
    """
    limits, box = domain.preset.limits, domain.preset.operating_box
    core_K, coolant_K = boxes.core_K, boxes.coolant_K
    psi = domain.chain_value(boxes.surface_K, boxes.core_gap_K, boxes.coolant_gap_K)
    excluded: Mask = (
        (core_K.low > limits.max_core_temperature_K)
        | (psi.high < 0.0)
        | (core_K.high < box.surface_temperature_K[0])
        | (coolant_K.low > box.coolant_temperature_K[1])
        | (coolant_K.high < box.coolant_temperature_K[0])
    )
    for flow in domain.flows:
        excluded |= flow.rate(boxes.core_gap_K, boxes.coolant_gap_K).low > flow.largest
    excluded |= boxes.value(case.decided).high + gain + case.allowance < 0.0
    return excluded


def _lacking(
    domain: Domain, case: Case, boxes: Boxes, rates: Rates, gain: Any, by_history: bool
) -> Array:
    """Least that the required condition has to be at the reading, less what the decision leaves."""
    required, slope = case.required, weights(case.required)
    fall = -(
        rates.core * (boxes.current_A * required.coupling + slope.core)
        + rates.surface * slope.surface
        + rates.coolant * slope.coolant
    )
    steepest = np.maximum(fall.high, 0.0)
    if by_history:
        steepest = np.minimum(steepest, largest_fall(domain, required, boxes))
    left = np.maximum(
        boxes.value(required).low,
        boxes.value(required.less(case.decided)).low - gain - case.allowance,
    )
    begins_s = (0.0, domain.preset.timing.delay_s)
    lacking: Array = np.max(
        [
            -held_integral(left, steepest, case.decay_per_s, begin_s, domain.held_s)
            / held_integral(1.0, 0.0, case.decay_per_s, begin_s, domain.held_s)
            for begin_s in begins_s
        ],
        axis=0,
    )
    return lacking


def _core_is_far(domain: Domain, boxes: Boxes, rates: Rates) -> Mask:
    """Whether the core cannot reach its limit within the hold."""
    rise_K = domain.held_s * np.maximum(rates.core.high, 0.0)
    far: Mask = boxes.core_K.high + rise_K < domain.preset.limits.max_core_temperature_K
    return far


def _surface_is_far(domain: Domain, boxes: Boxes, rates: Rates) -> Mask:
    """Whether psi, with the least favourable disturbance, cannot reach zero within the hold."""
    psi = domain.chain_value(boxes.surface_K, boxes.core_gap_K, boxes.coolant_gap_K)
    worst = psi.low - 2.0 * domain.preset.uncertainty.surface_K_per_s
    cell, first_per_s = domain.cell, domain.chain.first_per_s
    capacity = cell.surface_heat_capacity_J_per_K
    moved = domain.held_s * (
        (rates.core.magnitude + rates.surface.magnitude) / (cell.core_resistance_K_per_W * capacity)
        + (rates.surface.magnitude + rates.coolant.magnitude)
        / (cell.surface_resistance_K_per_W * capacity)
        + first_per_s * rates.surface.magnitude
    )
    far: Mask = worst - moved > 0.0
    return far


def _reading_gain(decided: Condition, errors: ReadingErrors, current: Interval) -> Any:
    """By how much the condition as decided, with its error term, can exceed that at true values."""
    slope = weights(decided)
    readings = (
        abs(slope.surface) * errors.surface_K
        + abs(slope.coolant) * errors.coolant_K
        + abs(decided.cooling) * errors.cooling_W
    )
    e = decided.error_bound_K
    if decided.error_term is ErrorTerm.ABSOLUTE:
        return readings
    estimate = (current * decided.coupling + decided.core_gap).magnitude * e
    if decided.error_term is ErrorTerm.SIGNED:
        estimate = estimate + (current * decided.coupling).high * e
    return readings + estimate


def _scores(domain: Domain, case: Case, boxes: Boxes) -> Array:
    """Width of each side times what it contributes to the bounds, to halve the widest so."""
    slope, cell = weights(case.required), domain.cell
    rc, rs = cell.core_resistance_K_per_W, cell.surface_resistance_K_per_W
    cc, cs = cell.core_heat_capacity_J_per_K, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    limit_K = domain.preset.limits.max_core_temperature_K
    strongest_A = -domain.preset.limits.reference_current_A

    def by_side(c: Condition) -> Array:
        per_A = abs(c.coupling) * limit_K + 2.0 * abs(c.squared) * strongest_A
        return np.abs([c.room, c.core_gap, c.coolant_gap, per_A, c.cooling])

    falls = np.abs(
        [
            0.0,
            slope.surface / (rc * cs) - slope.core / (rc * cc),
            slope.coolant / (rs * cinf) - slope.surface / (rs * cs),
            0.0,
            slope.coolant / cinf,
        ]
    )
    scores: Array = (boxes.high - boxes.low) * (
        domain.held_s * falls
        + by_side(case.required.less(case.decided))
        + 1e-3 * by_side(case.required)
        + 1e-12
    )
    return scores
