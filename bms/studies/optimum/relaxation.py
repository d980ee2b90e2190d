"""The convex relaxation of a charge of a given duration, as numbers.

Every charge of the cell that keeps its limits is a point of it. What is not convex is replaced by
something that allows more:

- ohmic and reversible heat by the least resistance and dU/dT over the ranges of a sample;
- E Tc u, a product of two unknowns, by the greater of two planes below it (McCormick's);
- open-circuit voltage and current map by their convex and concave envelopes over the ranges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.studies.optimum.charge import Charge
from bms.studies.optimum.ranges import Ranges, map_planes, ranges_of, voltage_lines


@dataclass(frozen=True)
class Relaxation:
    """A charge of a duration in N samples, with what bounds it in each.

    `voltage` (N, lines, 2) are lines a + b soc below the open-circuit voltage, `current_map`
    (N, planes, 3) planes a + b Ts + c soc above the map, none of them without a map.
    `anchor_K` (N, 2) are the core temperatures of the two planes below the reversible heat:
    E first v and E (second v + strongest (Tc - second)).
    """

    charge: Charge
    ranges: Ranges
    voltage: Array
    current_map: Array
    anchor_K: Array

    @property
    def entropic_V_per_K(self) -> Array:
        """Least dU/dT (N,) in each sample."""
        return self.ranges.entropic_V_per_K[0]


def relax(charge: Charge, duration_s: float, samples: int) -> Relaxation:
    """The relaxation of every charge that is full after duration_s."""
    ranges = ranges_of(charge, duration_s, samples)
    coldest_K, hottest_K = ranges.core_K
    warms = (ranges.entropic_V_per_K[0] >= 0.0)[:, None]
    planes = []
    if charge.current_map is not None:
        # One envelope for all samples would do; those of the ranges are closer to the map.
        planes = [
            map_planes(charge.current_map, (cold, hot), (low, high))
            for cold, hot, low, high in zip(*ranges.surface_K, *ranges.soc)
        ]
    return Relaxation(
        charge=charge,
        ranges=ranges,
        voltage=_stacked([voltage_lines(charge.cell, ends) for ends in zip(*ranges.soc)]),
        current_map=_stacked(planes) if planes else np.zeros((samples, 0, 3)),
        anchor_K=np.where(
            warms,
            np.column_stack([coldest_K, hottest_K]),
            np.column_stack([hottest_K, coldest_K]),
        ),
    )


def _stacked(rows: list[Array]) -> Array:
    """Arrays of different lengths in one, filled up by repetition of their last row."""
    longest = max(len(row) for row in rows)
    return np.array(
        [np.concatenate([row, np.repeat(row[-1:], longest - len(row), 0)]) for row in rows]
    )
