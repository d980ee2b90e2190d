"""Proof that a charge cannot be larger: weak duality in continuous time, without a solver.

Whatever non-negative prices m(t) are put on the limits, no charge that keeps them is worth more
than its Lagrangian, and the largest value of that is found point by point. With the temperatures'
adjoint y, -dy/dt = A'y + m, a watt of heat at the time t costs lambda = y_core/Cc, and

  charge <= constant + integral over t of  max over 0 <= v <= strongest of  c(t) v - lambda R v^2

where c(t) collects the prices of everything that is linear in the current v = |u|: 1 for the charge
itself, open-circuit voltage, ohmic drop, branches, reversible heat, map and ramp. v may be any
function of time. The prices come from a program of piecewise constant currents; poor prices make
the bound weaker, never wrong. What is left is the error of the quadrature, a Simpson rule.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.studies.optimum.multipliers import Multipliers
from bms.studies.optimum.relaxation import Relaxation

POINTS = 8
"""Parts of a sample for the quadrature, an even number."""
_TRIES = 4


def most_charge_As(relaxation: Relaxation, prices: Multipliers, points: int = POINTS) -> float:
    """Charge in A s that no current of the relaxation's duration exceeds."""
    share = prices.core_share
    for _ in range(_TRIES):
        adjoint = _adjoint(relaxation, replace(prices, core_share=share), points)
        # Where heat is worth something (it opens the map) the second plane is no bound.
        gains = np.any(adjoint.heat < 0.0, axis=1) & (share > 0.0)
        if not np.any(gains):
            break
        share = np.where(gains, 0.0, share)
    else:
        share = np.zeros_like(share)
        adjoint = _adjoint(relaxation, replace(prices, core_share=share), points)
    return _value(relaxation, replace(prices, core_share=share), adjoint)


@dataclass(frozen=True)
class _Adjoint:
    """Costs over N samples with P + 1 points each: of temperatures (N, P + 1, 3), of heat, a W."""

    temperatures: Array
    heat: Array
    part_s: float


def _second_weight(relaxation: Relaxation, prices: Multipliers) -> Array:
    """Weight (N,) in V A/K of the core temperature in the reversible heat, by the second plane."""
    weight: Array = relaxation.entropic_V_per_K * prices.core_share * relaxation.ranges.strongest_A
    return weight


def _adjoint(relaxation: Relaxation, prices: Multipliers, points: int) -> _Adjoint:
    """The temperatures' costs, exact for prices that are constant in a sample; backwards."""
    charge, ranges = relaxation.charge, relaxation.ranges
    part_s, heating = ranges.step_s / points, charge.heating
    drive = np.zeros((ranges.samples, 4, 4))
    drive[:, :3, :3] = charge.dynamics.T
    drive[:, 0, 0] += _second_weight(relaxation, prices) * heating[0]
    drive[:, 0, 3] = prices.core
    opening = np.sum(prices.current_map * relaxation.current_map[:, :, 1], axis=1)
    drive[:, 1, 3] = prices.surface - opening
    step = expm(drive * part_s)
    costs = np.zeros((ranges.samples, points + 1, 3))
    last = np.zeros(3)
    for k in range(ranges.samples - 1, -1, -1):
        costs[k, points] = last
        for j in range(points - 1, -1, -1):
            costs[k, j] = step[k, :3, :3] @ costs[k, j + 1] + step[k, :3, 3]
        last = costs[k, 0]
    return _Adjoint(costs, costs[:, :, 0] * heating[0], part_s)


def _value(relaxation: Relaxation, prices: Multipliers, adjoint: _Adjoint) -> float:
    """Largest value of the Lagrangian in A s."""
    charge, ranges, heat = relaxation.charge, relaxation.ranges, adjoint.heat
    costs_heat = heat >= 0.0
    ohm = np.where(costs_heat, ranges.resistance_ohm[0][:, None], ranges.resistance_ohm[1][:, None])
    linear = 1.0 + _charge_cost(relaxation, prices, adjoint.part_s)
    linear -= (ranges.resistance_ohm[0] * prices.voltage.sum(axis=1))[:, None]
    linear -= prices.current_map.sum(axis=1)[:, None]
    linear -= heat * np.where(
        costs_heat, _least_reversible_V(relaxation, prices)[:, None], _most_reversible_V(relaxation)
    )
    linear += (np.diff(prices.ramp) / ranges.step_s)[:, None]
    tangent_W, branches = _branches(relaxation, prices, adjoint)
    linear -= branches

    strongest = ranges.strongest_A[:, None]
    peak = linear / np.maximum(2.0 * np.abs(heat) * ohm, 1e-300)
    current = np.clip(np.where(linear > 0.0, peak, 0.0), 0.0, strongest)
    at_most = linear * strongest - heat * ohm * strongest**2
    best = np.where(costs_heat, (linear - heat * ohm * current) * current, np.maximum(at_most, 0.0))
    second_K = relaxation.anchor_K[:, 1]
    offset_W = _second_weight(relaxation, prices) * (charge.start_K - second_K)
    best = (
        best - adjoint.temperatures @ charge.cooling - heat * offset_W[:, None] + heat * tangent_W
    )
    return _simpson(best, adjoint.part_s) + _constant(relaxation, prices)


def _constant(relaxation: Relaxation, prices: Multipliers) -> float:
    """What the limits are worth where the state is that of the start, in A s."""
    charge, ranges, limits = relaxation.charge, relaxation.ranges, relaxation.charge.limits
    room_V = limits.max_voltage_V - relaxation.voltage @ (1.0, charge.start_soc)
    room_A = relaxation.current_map @ (1.0, charge.start_K, charge.start_soc)
    rate = (
        prices.core * (limits.max_core_temperature_K - charge.start_K)
        + prices.surface * (limits.max_surface_temperature_K - charge.start_K)
        + np.sum(prices.voltage * room_V, axis=1)
        + np.sum(prices.current_map * room_A, axis=1)
    )
    growth = charge.growth_A_per_s or 0.0
    between_s2 = 0.5 * (prices.ramp[1:] + prices.ramp[:-1]) * ranges.step_s
    # A command that is held for a period is ahead of its ramp by no more than a period.
    falls_s = -np.minimum(np.diff(prices.ramp), 0.0).sum()
    ahead_s2 = charge.period_s * (falls_s + prices.ramp.max())
    return float(rate.sum() * ranges.step_s + growth * (between_s2.sum() + ahead_s2))


def _charge_cost(relaxation: Relaxation, prices: Multipliers, part_s: float) -> Array:
    """Worth (N, P + 1) of 1 A s that is in the cell from then on: it raises voltage, closes map."""
    ranges = relaxation.ranges
    points = round(ranges.step_s / part_s)
    rate = np.sum(prices.current_map * relaxation.current_map[:, :, 2], axis=1)
    rate -= np.sum(prices.voltage * relaxation.voltage[:, :, 1], axis=1)
    after = np.concatenate([np.cumsum(rate[::-1])[::-1][1:], [0.0]]) * ranges.step_s
    left_s = ranges.step_s * (1.0 - np.arange(points + 1) / points)
    cost: Array = after[:, None] + rate[:, None] * left_s[None, :]
    return cost / relaxation.charge.cell.capacity_As


def _least_reversible_V(relaxation: Relaxation, prices: Multipliers) -> Array:
    """Reversible heat (N,) of 1 A at least, the core's own part of the second plane left out."""
    first_K, second_K = relaxation.anchor_K.T
    kelvin = (1.0 - prices.core_share) * first_K + prices.core_share * second_K
    least_V: Array = relaxation.entropic_V_per_K * kelvin
    return least_V


def _most_reversible_V(relaxation: Relaxation) -> Array:
    greatest = np.maximum(relaxation.ranges.entropic_V_per_K[1], 0.0)
    most_V: Array = (greatest * relaxation.ranges.core_K[1])[:, None]
    return most_V


def _branches(
    relaxation: Relaxation, prices: Multipliers, adjoint: _Adjoint
) -> tuple[Array, Array]:
    """Constant part of the branches' heat by its tangent, in W, and what they make 1 A cost."""
    ranges, heat = relaxation.ranges, adjoint.heat
    points = heat.shape[1] - 1
    constant_W, cost = np.zeros_like(heat), np.zeros_like(heat)
    across = np.linspace(0.0, 1.0, points + 1)
    strongest = float(np.max(ranges.strongest_A))
    for branch, at_V in zip(relaxation.charge.cell.branches, prices.polarisation_V.T):
        tangent_V = at_V[:-1, None] + across * np.diff(at_V)[:, None]
        # V^2/R is above its tangent, and below its chord up to the strongest current.
        slope_A = np.where(heat >= 0.0, 2.0 * tangent_V / branch.resistance_ohm, strongest)
        constant_W += np.where(heat >= 0.0, tangent_V**2 / branch.resistance_ohm, 0.0)
        rate = prices.voltage.sum(axis=1)[:, None] + heat * slope_A
        fed = branch.resistance_ohm / branch.time_constant_s
        cost += fed * _discounted(rate, adjoint.part_s, branch.time_constant_s)
    return constant_W, cost


def _discounted(rate: Array, part_s: float, time_constant_s: float) -> Array:
    """Integral (N, P + 1) of exp(-(t - now)/tau) rate(t) from now on; rate linear in each part."""
    kept = float(np.exp(-part_s / time_constant_s))
    whole = time_constant_s * (1.0 - kept)
    later = (time_constant_s * whole - time_constant_s * part_s * kept) / part_s
    total = np.zeros_like(rate)
    last = 0.0
    for k in range(len(rate) - 1, -1, -1):
        total[k, -1] = last
        for j in range(rate.shape[1] - 2, -1, -1):
            gained = rate[k, j] * (whole - later) + rate[k, j + 1] * later
            total[k, j] = kept * total[k, j + 1] + gained
        last = total[k, 0]
    return total


def _simpson(values: Array, part_s: float) -> float:
    """Integral over all samples of values (N, P + 1) at equal distances."""
    weights = np.ones(values.shape[1])
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return float((values @ weights).sum() * part_s / 3.0)
