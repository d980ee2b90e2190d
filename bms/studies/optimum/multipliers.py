"""Prices of the limits over the samples of a duration, from which a bound is certified."""

from __future__ import annotations

from dataclasses import dataclass

from bms.arrays import Array


@dataclass(frozen=True)
class Multipliers:
    """What a unit of each limit would be worth, constant in each of N samples; none negative.

    The unit is A s of charge a second of the limit: `core` and `surface` (N,) for 1 K, `voltage`
    (N, lines) for 1 V at each line of the open-circuit voltage, `current_map` (N, planes) for 1 A
    at each of its planes. `ramp` (N + 1,) in s is linear between the ends of the samples and 0 at
    the last. `core_share` (N,), 0 to 1, weighs the two bounds on the reversible heat.
    `polarisation_V` (N + 1, branches) is where the heat of the branches is replaced by its tangent.
    """

    core: Array
    surface: Array
    voltage: Array
    current_map: Array
    ramp: Array
    core_share: Array
    polarisation_V: Array
