"""How fast temperatures, and with them a condition, can change while a decision acts."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.verification.boxes import Boxes
from bms.verification.conditions import Condition
from bms.verification.domain import Domain, Rates
from bms.verification.intervals import Interval

NARROWINGS = 2
FLOAT64_SHARE = 1e-9
"""Far above the relative error of an exponential of a matrix and of sums of a few numbers."""


def drift_gain_s(domain: Domain) -> Array:
    """Matrix that takes the largest rates at a reading to the largest drifts in a hold; 3 by 3.

    A rate differs from that at the reading by no more than the heat flows that the drifts make, so
    the drifts d obey d' <= r + K d with K >= 0, hence d <= (integral of exp(K t)) r.
    """
    cell = domain.cell
    core_W, coolant_W = 1.0 / cell.core_resistance_K_per_W, 1.0 / cell.surface_resistance_K_per_W
    flows = np.array(
        [
            [core_W, core_W, 0.0],
            [core_W, core_W + coolant_W, coolant_W],
            [0.0, coolant_W, coolant_W],
        ]
    )
    capacities = np.array(
        [
            cell.core_heat_capacity_J_per_K,
            cell.surface_heat_capacity_J_per_K,
            cell.coolant_heat_capacity_J_per_K,
        ]
    )
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[:3, 3:] = flows / capacities[:, None], np.eye(3)
    gain: Array = expm(whole * domain.held_s)[:3, 3:] * (1.0 + FLOAT64_SHARE)
    return gain


def held_rates(domain: Domain, gain_s: Array, boxes: Boxes) -> Rates:
    """Enclosure of the rates at every instant of the hold; gain_s as by `drift_gain_s`.

    From the first one on each pass may narrow it, for what drifts in one direction only does so
    over the whole hold.
    """
    held_s, cooling_W = domain.held_s, boxes.cooling_W
    core_gap, coolant_gap = boxes.core_gap_K, boxes.coolant_gap_K
    now = [rate.magnitude for rate in domain.rates(core_gap, coolant_gap, cooling_W)]
    core_K, surface_K, coolant_K = gain_s @ np.stack(np.broadcast_arrays(*now))
    rates = domain.rates(
        core_gap.widened(core_K + surface_K), coolant_gap.widened(surface_K + coolant_K), cooling_W
    )
    for _ in range(NARROWINGS):
        rates = domain.rates(
            _drifted(core_gap, rates.core - rates.surface, held_s),
            _drifted(coolant_gap, rates.surface - rates.coolant, held_s),
            cooling_W,
        )
    return rates


def largest_fall(domain: Domain, condition: Condition, boxes: Boxes) -> Array:
    """Most that the domain's condition falls per second at the current held, of every box.

    The domain bounds the fall in every history of a cell from rest, at the reading and also at
    every later instant of the hold, which continues that history.
    """
    fall, cooling_core, warming_core = domain.flows[:3]
    core_rate = warming_core if condition.coupling > 0.0 else cooling_core
    coupled = abs(condition.coupling) * np.maximum(-boxes.current_A.low, 0.0) * core_rate.largest
    return np.asarray((fall.largest + coupled) * (1.0 + FLOAT64_SHARE))


def _drifted(start: Interval, rate: Interval, held_s: float) -> Interval:
    return start + Interval(
        np.minimum(rate.low, 0.0) * held_s, np.maximum(rate.high, 0.0) * held_s
    ).widened(0.0)
