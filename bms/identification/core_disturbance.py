"""Disturbance of an unmeasured core: at rest, how it grows with the current, what it costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bms.arrays import Array
from bms.barrier.family import extremes
from bms.cell import CellParameters
from bms.identification.cell_identification import IdentifiedCell, thermal_record
from bms.identification.disturbance_bound import (
    SHARE,
    STRETCHES,
    Growth,
    disturbance_bound,
)
from bms.identification.lumped_disturbance import lumped_missing_K_per_s
from bms.identification.surface_thermal import heat_W
from bms.presets.schema import Limits, Uncertainty

LEAST_K_PER_S = 5e-4
"""Assumed where the recordings show less."""
UNTOLD_K_PER_S = 4.0 * LEAST_K_PER_S
"""Assumed where no recording warms with its ambient."""
REST_C = 0.125
"""Up to this rate a current's own heat is so small that what is missing is missing at rest."""
REST_ACCURACY_K, ACCURACY_K = 0.05, 0.1
"""Within which the surface is followed: a smooth rate that lags behind what is missing shows less
of it. At rest nothing else moves the surface, so that half as much is noise.
"""
LEAST_REST_S = 1800.0
"""Of one stretch of it: in a shorter one a slow error has not shown, and a pulse's may have."""


@dataclass(frozen=True)
class CoreDisturbance:
    """Bound on what the core's rate lacks, with where it comes from and what would tighten it."""

    bound: Growth
    at_rest: str
    growing: str
    remark: str | None


def core_disturbance(cell: IdentifiedCell) -> CoreDisturbance:
    """Bound from the surface of every recording of the described cell with its ambient.

    A missing rate is heat that the whole cell lacks, of the core's heat capacity alone. Stretches
    of half an hour up to C/8 say what is missing at rest; what stronger currents need beyond it is
    taken to grow with them, as an error of their heat does. Both cover 99.9 % of the rows,
    conformal; rows of shorter pauses have the rate of the currents around them, over which it is
    averaged. Without such a stretch the strong currents' bound holds at rest too.
    """
    if not cell.is_thermal_fitted:
        told = "assumed: no recording warms by 2 K with its ambient"
        return CoreDisturbance(Growth(UNTOLD_K_PER_S), told, told, None)
    rate_K_per_s, current_A, step_s = _missing(cell, ACCURACY_K)
    is_slow = np.abs(current_A) <= REST_C * cell.alignment.capacity_Ah
    rows = _rests(is_slow.tolist(), step_s)
    if int(np.sum(rows)) < STRETCHES:
        growth = disturbance_bound(rate_K_per_s, current_A, grows=True).conformal
        told = "fitted: what the surface's residuals need in 99.9 % of the rows, conformal"
        return CoreDisturbance(
            _at_least(growth),
            f"{told}; of strong currents, as no half an hour is at C/8 or less",
            told,
            "the disturbance at rest is that of strong currents: a recording of half an hour at "
            "C/8 or less, with surface and ambient, tells it apart",
        )
    rest_s = float(np.sum(step_s[rows]))
    resting_K_per_s = _missing(cell, REST_ACCURACY_K)[0][rows]
    at_rest = disturbance_bound(resting_K_per_s, current_A[rows], grows=False).conformal
    resting = (
        f"fitted: what the surface's residuals need at C/8 or less ({rest_s / 3600.0:.1f} h), at "
        f"least {LEAST_K_PER_S:g} assumed"
    )
    if int(np.sum(~is_slow)) < STRETCHES:
        bound = Growth(
            _at_least(at_rest).constant_K_per_s, UNTOLD_K_PER_S / cell.alignment.capacity_Ah
        )
        told = "assumed: no recording with its ambient has more than C/8"
        return CoreDisturbance(bound, resting, told, None)
    return CoreDisturbance(
        _growing(rate_K_per_s[~is_slow], current_A[~is_slow], _at_least(at_rest)),
        resting,
        "fitted: what they need beyond that at the other currents, in 99.9 % of the rows, "
        "conformal",
        None,
    )


def _missing(cell: IdentifiedCell, accuracy_K: float) -> tuple[Array, Array, Array]:
    """Rates of the core (N,), currents (N,) and how long each row lasts (N,), one after another."""
    fit, parts = cell.thermal[0], []
    total_J_per_K = fit.core_heat_capacity_J_per_K + fit.surface_heat_capacity_J_per_K
    per_core = total_J_per_K / fit.core_heat_capacity_J_per_K
    for recording, soc, specimen in zip(
        cell.recordings, cell.alignment.soc, cell.alignment.specimens
    ):
        if specimen or recording.surface_K is None or recording.ambient_K is None:
            continue
        irreversible_W = recording.current_A * (cell.electrical.ocv(soc) - recording.voltage_V)
        record = thermal_record(recording, soc, irreversible_W)
        heat = heat_W(record, fit.entropic_V_per_K)
        rate = lumped_missing_K_per_s(fit, record, heat, accuracy_K)
        lasts_s = np.append(np.diff(record.time_s), 0.0)
        parts.append((per_core * rate, record.current_A, lasts_s))
    rates, currents, lengths = (np.concatenate(column) for column in zip(*parts))
    return rates, currents, lengths


def _rests(is_slow: Sequence[bool], step_s: Array) -> NDArray[np.bool_]:
    """Rows (N,) of stretches of slow ones that last half an hour; a recording ends with a 0 s."""
    found = np.zeros(len(is_slow), dtype=bool)
    begin, length_s = 0, 0.0
    for row, slow in enumerate(is_slow):
        if not slow:
            begin, length_s = row + 1, 0.0
            continue
        length_s += float(step_s[row])
        if length_s >= LEAST_REST_S:
            found[begin : row + 1] = True
        if step_s[row] == 0.0:
            begin, length_s = row + 1, 0.0
    return found


def _growing(rate_K_per_s: Array, current_A: Array, at_rest: Growth) -> Growth:
    """The bound at rest, and the least growth with which SHARE of the rows is covered.

    The most that one of 19 stretches needs, so that it covers as much of a further one that is
    exchangeable with them, with probability 19/20.
    """
    over = np.maximum(np.abs(rate_K_per_s) - at_rest.constant_K_per_s, 0.0)
    needed = over / np.abs(current_A)
    per_A = max(_covered(stretch) for stretch in np.array_split(needed, STRETCHES))
    return Growth(at_rest.constant_K_per_s, per_A, 0.0)


def _covered(values: Array) -> float:
    return float(np.quantile(values, SHARE, method="higher"))


def _at_least(growth: Growth) -> Growth:
    return Growth(
        max(growth.constant_K_per_s, LEAST_K_PER_S),
        growth.per_A_K_per_As,
        growth.per_A2_K_per_A2s,
    )


def warmest_coolant_K(cell: CellParameters, limits: Limits, noise: Uncertainty) -> float:
    """Coolant beside which 0 A keeps a family's limits (docs/family.md), in whole 0.01 K."""
    assert cell.interval is not None
    ends = extremes(cell, cell.interval)
    core_W = ends.core_heat_capacity[1] * noise.core_K_per_s
    through_W = core_W + ends.surface_heat_capacity[1] * noise.surface_K_per_s
    below_K = ends.core_resistance[1] * core_W + ends.surface_resistance[1] * through_W
    lowest_K = min(limits.max_core_temperature_K, limits.max_surface_temperature_K)
    return math.floor(100.0 * (lowest_K - below_K)) / 100.0
