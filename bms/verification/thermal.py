"""Branch and bound over the thermal domain: which boxes a decision keeps safe until the next one.

For a box of states, currents and cooling power one of these is shown, with intervals rounded
outward:

  excluded   no state of the box is in the domain, or no reading of it admits such a current
  far        the barrier is further from zero than it can move within the held time
  held       the condition G holds long enough: G >= g at the reading and falls no faster than r, so
             the barrier, which obeys b' + lambda b = G, is not negative at any instant of the hold

A box of which none can be shown is halved. What is left below the smallest size is reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bms.arrays import Array
from bms.verification.conditions import Condition, ErrorTerm, ReadingErrors
from bms.verification.domain import Domain, Point, Rates, weights
from bms.verification.intervals import Interval

LARGEST_BATCH = 20_000


@dataclass(frozen=True)
class Case:
    """One barrier: what has to hold, what is decided by, and the barrier's own decay rate.

    `rounding` is what the firmware's arithmetic can take from the decided condition, in its unit.
    """

    name: str
    required: Condition
    decided: Condition
    decay_per_s: float
    rounding: float


@dataclass(frozen=True)
class Certificate:
    """Result of one case; `open_low` and `open_high` span the boxes that nothing was shown of."""

    name: str
    boxes: int
    open_boxes: int
    open_low: Point | None = None
    open_high: Point | None = None

    @property
    def holds(self) -> bool:
        """Whether every box was shown safe."""
        return self.open_boxes == 0


def certify(domain: Domain, case: Case, errors: ReadingErrors, largest_boxes: int) -> Certificate:
    """Branch and bound for one barrier; stops undecided at largest_boxes."""
    low = np.array([[float(value) for value in domain.low]])
    high = np.array([[float(value) for value in domain.high]])
    pending = [(low, high)]
    boxes = 0
    while pending and boxes < largest_boxes:
        low, high = pending.pop()
        boxes += len(low)
        undecided, scores = _examine(domain, case, errors, low, high)
        low, high = _halved(low[undecided], high[undecided], scores[undecided])
        for start in range(0, len(low), LARGEST_BATCH):
            part = slice(start, start + LARGEST_BATCH)
            pending.append((low[part], high[part]))
    left_low = np.concatenate([low for low, _ in pending]) if pending else np.empty((0, 5))
    left_high = np.concatenate([high for _, high in pending]) if pending else np.empty((0, 5))
    return Certificate(
        case.name,
        boxes,
        len(left_low),
        Point(*left_low.min(axis=0).tolist()) if len(left_low) else None,
        Point(*left_high.max(axis=0).tolist()) if len(left_high) else None,
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


def _examine(
    domain: Domain, case: Case, errors: ReadingErrors, low: Array, high: Array
) -> tuple[npt.NDArray[np.bool_], Array]:
    """Which boxes stay undecided, and how much each side of a box matters."""
    surface, core_gap, coolant_gap, current, cooling = (
        Interval(low[:, i], high[:, i]) for i in range(5)
    )
    core, coolant = surface + core_gap, surface - coolant_gap
    limits, held_s = domain.preset.limits, domain.held_s
    box = domain.preset.operating_box
    psi = domain.chain_value(surface, core_gap, coolant_gap)
    required, decided = case.required, case.decided

    outside = (core.low > limits.max_core_temperature_K) | (psi.high < 0.0)
    outside |= (core.high < box.surface_temperature_K[0]) | (
        coolant.low > box.coolant_temperature_K[1]
    )
    outside |= coolant.high < box.coolant_temperature_K[0]
    for flow in domain.flows:
        outside |= flow.rate(core_gap, coolant_gap).low > flow.largest

    gain = _reading_gain(decided, errors, current)
    admitted = _value(decided, core_gap, coolant_gap, surface, core, current, cooling)
    outside |= admitted.high + gain + case.rounding < 0.0

    rates, enclosed = _held_rates(domain, core_gap, coolant_gap, cooling)
    slope = weights(required)
    fall = -(
        rates.core * (current * required.coupling + slope.core)
        + rates.surface * slope.surface
        + rates.coolant * slope.coolant
    )
    steepest = np.maximum(fall.high, 0.0)
    least = np.maximum(
        _value(required, core_gap, coolant_gap, surface, core, current, cooling).low,
        _difference(required, decided, core_gap, coolant_gap, surface, core, current, cooling).low
        - gain
        - case.rounding,
    )
    timing = domain.preset.timing
    integrals = [
        held_integral(least, steepest, case.decay_per_s, begin_s, held_s)
        for begin_s in (0.0, timing.delay_s)
    ]
    held = enclosed & np.all([integral >= 0.0 for integral in integrals], axis=0)
    if case.name == "core":
        far = core.high + held_s * np.maximum(rates.core.high, 0.0) < limits.max_core_temperature_K
    else:
        # psi with the least favourable disturbance, and how far it can move.
        worst = psi.low - 2.0 * domain.preset.uncertainty.surface_K_per_s
        cell, first = domain.cell, domain.chain.first_per_s
        capacity = cell.surface_heat_capacity_J_per_K
        moved = held_s * (
            (rates.core.magnitude + rates.surface.magnitude)
            / (cell.core_resistance_K_per_W * capacity)
            + (rates.surface.magnitude + rates.coolant.magnitude)
            / (cell.surface_resistance_K_per_W * capacity)
            + first * rates.surface.magnitude
        )
        far = worst - moved > 0.0
    shown = outside | (enclosed & far)
    return ~(shown | held), _scores(domain, case, low, high)


def _held_rates(
    domain: Domain, core_gap: Interval, coolant_gap: Interval, cooling: Interval
) -> tuple[Rates, npt.NDArray[np.bool_]]:
    """Enclosure of the rates over the hold, and where it is proven.

    A first guess of twice the drift proves itself where the drift within it is no larger. From then
    on each pass may narrow it, for what drifts in one direction only does so over the whole hold.
    """
    held_s = domain.held_s
    guess = [2.0 * held_s * rate.magnitude for rate in domain.rates(core_gap, coolant_gap, cooling)]
    rates = domain.rates(
        core_gap.widened(guess[0] + guess[1]), coolant_gap.widened(guess[1] + guess[2]), cooling
    )
    enclosed = np.all([held_s * r.magnitude <= g for r, g in zip(rates, guess)], axis=0)
    for _ in range(2):
        rates = domain.rates(
            _drifted(core_gap, rates.core - rates.surface, held_s),
            _drifted(coolant_gap, rates.surface - rates.coolant, held_s),
            cooling,
        )
    return rates, enclosed


def _drifted(start: Interval, rate: Interval, held_s: float) -> Interval:
    return start + Interval(
        np.minimum(rate.low, 0.0) * held_s, np.maximum(rate.high, 0.0) * held_s
    ).widened(0.0)


def _value(
    c: Condition,
    core_gap: Interval,
    coolant_gap: Interval,
    surface: Interval,
    core: Interval,
    current: Interval,
    cooling: Interval,
) -> Interval:
    return (
        core_gap * c.core_gap
        - coolant_gap * c.coolant_gap
        + (c.limit_K - surface) * c.room
        + core * current * c.coupling
        + current.square() * c.squared
        + cooling * c.cooling
        - c.reserve
    )


def _difference(
    a: Condition,
    b: Condition,
    core_gap: Interval,
    coolant_gap: Interval,
    surface: Interval,
    core: Interval,
    current: Interval,
    cooling: Interval,
) -> Interval:
    """Enclosure of a - b; equal coefficients cancel before any interval is formed."""
    shift = a.room * (a.limit_K - b.limit_K)
    both = Condition(
        b.limit_K,
        a.core_gap - b.core_gap,
        a.coolant_gap - b.coolant_gap,
        a.room - b.room,
        a.coupling - b.coupling,
        a.squared - b.squared,
        a.cooling - b.cooling,
        a.reserve - b.reserve - shift,
    )
    return _value(both, core_gap, coolant_gap, surface, core, current, cooling)


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


def _scores(domain: Domain, case: Case, low: Array, high: Array) -> Array:
    """Width of each side times what it contributes to the bounds, to halve the widest so."""
    a, b = case.required, case.decided
    slope, cell = weights(a), domain.cell
    rc, rs = cell.core_resistance_K_per_W, cell.surface_resistance_K_per_W
    cc, cs = cell.core_heat_capacity_J_per_K, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    limit_K = domain.preset.limits.max_core_temperature_K
    strongest_A = -domain.preset.limits.reference_current_A

    def by_side(c: Condition) -> Array:
        per_A = abs(c.coupling) * limit_K + 2.0 * abs(c.squared) * strongest_A
        return np.abs([c.room, c.core_gap, c.coolant_gap, per_A, c.cooling])

    gap = Condition(
        0.0, a.core_gap - b.core_gap, a.coolant_gap - b.coolant_gap, a.room - b.room,
        a.coupling - b.coupling, a.squared - b.squared, a.cooling - b.cooling, 0.0,
    )  # fmt: skip
    falls = np.abs(
        [
            0.0,
            slope.surface / (rc * cs) - slope.core / (rc * cc),
            slope.coolant / (rs * cinf) - slope.surface / (rs * cs),
            0.0,
            slope.coolant / cinf,
        ]
    )
    scores: Array = (high - low) * (
        domain.held_s * falls + by_side(gap) + 1e-3 * by_side(a) + 1e-12
    )
    return scores


def _halved(low: Array, high: Array, scores: Array) -> tuple[Array, Array]:
    rows, side = np.arange(len(low)), np.argmax(scores, axis=1)
    middle = 0.5 * (low[rows, side] + high[rows, side])
    upper_low, lower_high = low.copy(), high.copy()
    upper_low[rows, side] = middle
    lower_high[rows, side] = middle
    return np.concatenate([low, upper_low]), np.concatenate([lower_high, high])
