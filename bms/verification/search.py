"""Search for a state that a decision does not keep safe, shown by simulating the cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.barrier.readings import ReadingErrors, soc_error_bound
from bms.cell import CellState, Disturbance, integrate_step, terminal_voltage_V
from bms.verification.barriers import Barrier
from bms.verification.conditions import Condition, decided_conditions
from bms.verification.decision import decide
from bms.verification.domain import Domain, weights

SAMPLES = 200_000
SUB_STEPS = 40
LEAST_VIOLATION = 1e-9
"""Far above the rounding of a simulated step."""


@dataclass(frozen=True)
class CounterExample:
    """A safe state, what was read of it, the decision, and the barrier after the hold.

    `value` is the smallest of the barrier in the hold: V, K, or K/s for the surface chain.
    """

    barrier: str
    soc: float
    core_temperature_K: float
    surface_temperature_K: float
    coolant_temperature_K: float
    cooling_power_W: float
    surface_reading_error_K: float
    coolant_reading_error_K: float
    cooling_reading_error_W: float
    estimation_error_K: float
    soc_error: float
    current_A: float
    hold_s: float
    value: float


def find_counter_example(
    domain: Domain,
    constants: Mapping[str, Any],
    errors: ReadingErrors,
    barrier: Barrier,
    rng: np.random.Generator,
    samples: int = SAMPLES,
) -> CounterExample | None:
    """The worst of many simulated decisions from the edge of the safe set; None when all are safe.

    States are drawn with that barrier at zero;
    readings err to the side that lets most current through, disturbances are at the bounds that
    heat, and the current acts for the whole hold.
    """
    preset = domain.preset
    state, cooling_W = _edge_states(domain, barrier, rng, samples)
    core_condition, surface_condition = decided_conditions(constants)
    condition = surface_condition if barrier is Barrier.SURFACE else core_condition
    slips = _favourable_errors(condition, errors)
    estimation_K = rng.choice([-1.0, 0.0, 1.0], state.soc.shape) * condition.error_bound_K
    soc_error = soc_error_bound(preset.cell, preset)
    reading = CellState(
        state.soc - soc_error,
        state.core_temperature_K + estimation_K,
        state.surface_temperature_K + slips.surface_K,
        state.coolant_temperature_K + slips.coolant_K,
    )
    reference_A = preset.limits.reference_current_A
    current_A, upper_A, _ = decide(constants, reading, cooling_W + slips.cooling_W, reference_A)
    rows = np.flatnonzero(current_A <= upper_A)
    if not len(rows):
        return None
    chosen = CellState(*(part[rows] for part in state))
    lowest = simulate_hold(domain, chosen, current_A[rows], cooling_W[rows], barrier)
    worst = int(np.argmin(lowest))
    if not lowest[worst] < -LEAST_VIOLATION:
        return None
    row = rows[worst]
    return CounterExample(
        barrier=barrier.value,
        soc=float(state.soc[row]),
        core_temperature_K=float(state.core_temperature_K[row]),
        surface_temperature_K=float(state.surface_temperature_K[row]),
        coolant_temperature_K=float(state.coolant_temperature_K[row]),
        cooling_power_W=float(cooling_W[row]),
        surface_reading_error_K=slips.surface_K,
        coolant_reading_error_K=slips.coolant_K,
        cooling_reading_error_W=slips.cooling_W,
        estimation_error_K=float(estimation_K[row]),
        soc_error=-soc_error,
        current_A=float(current_A[row]),
        hold_s=domain.held_s,
        value=float(lowest[worst]),
    )


def simulate_hold(
    domain: Domain, state: CellState, current_A: Any, cooling_W: Any, barrier: Barrier
) -> Any:
    """Smallest value of a barrier while a current is held from a state, at heating disturbances.

    The surface disturbance starts at its lower bound for a chain of which it is a part, and rises
    as fast as its slope bound lets it. A chain that has its worst case in it falls fastest at one
    of the bounds. Any array shape.
    """
    preset, bounds = domain.preset, domain.preset.uncertainty
    step_s = domain.held_s / SUB_STEPS
    steps_s, surface = [step_s] * SUB_STEPS, bounds.surface_K_per_s
    highest = bounds.surface_K_per_s
    if barrier is Barrier.SURFACE and domain.chain_reserve_K_per_s > 0.0:
        # Warmth of the surface flows off: it lowers its rate, which is in the chain as well.
        outflow_per_s = domain.surface_rate(-1.0, 1.0)
        surface = highest = float(np.sign(domain.chain.first_per_s + outflow_per_s)) * highest
    elif barrier is Barrier.SURFACE:
        # The first steps resolve the rise of the surface disturbance.
        rise_s = 2.0 * bounds.surface_K_per_s / max(bounds.surface_rate_K_per_s2, 1e-12)
        steps_s = [rise_s] * (rise_s < step_s) + steps_s
        surface = -surface
    lowest = _barrier(domain, state, current_A, surface, barrier)
    for length_s in steps_s:
        after = min(surface + bounds.surface_rate_K_per_s2 * length_s * (1.0 + 1e-12), highest)
        state = integrate_step(
            preset.cell, state, current_A, cooling_W, length_s,
            _upward(domain, surface), _upward(domain, after),
        )  # fmt: skip
        surface = after
        lowest = np.minimum(lowest, _barrier(domain, state, current_A, surface, barrier))
    return lowest


def _upward(domain: Domain, surface: float) -> Disturbance:
    bounds = domain.preset.uncertainty
    return Disturbance(bounds.soc_per_s, bounds.core_K_per_s, surface, bounds.coolant_K_per_s)


def _barrier(
    domain: Domain, state: CellState, current_A: Any, surface_disturbance: float, barrier: Barrier
) -> Any:
    limits = domain.preset.limits
    soc, core_K, surface_K, coolant_K = state
    if barrier is Barrier.CORE:
        return limits.max_core_temperature_K - core_K
    if barrier is Barrier.VOLTAGE:
        return limits.max_voltage_V - terminal_voltage_V(domain.preset.cell, soc, current_A)
    best = domain.chain_value(surface_K, core_K - surface_K, surface_K - coolant_K)
    if domain.chain_reserve_K_per_s > 0.0:
        return best - domain.chain_reserve_K_per_s
    return best - domain.preset.uncertainty.surface_K_per_s - surface_disturbance


def _edge_states(
    domain: Domain, barrier: Barrier, rng: np.random.Generator, samples: int
) -> tuple[CellState, Array]:
    """States of the domain with one barrier at zero (for the voltage: near its limit)."""
    limits, box, low, high = (
        domain.preset.limits, domain.preset.operating_box, domain.low, domain.high,
    )  # fmt: skip
    soc = rng.uniform(0.05, limits.completion_soc, samples)
    cooling_W = rng.uniform(low.cooling_W, high.cooling_W, samples)
    surface_K = limits.max_surface_temperature_K - rng.uniform(0.0, 1.0, samples) ** 3 * (
        limits.max_surface_temperature_K - low.surface_K
    )
    core_gap = rng.uniform(-1.0, 20.0, samples)
    coolant_gap = rng.uniform(-2.0, 30.0, samples)
    if barrier is Barrier.CORE:
        core_gap = limits.max_core_temperature_K - surface_K
    elif barrier is Barrier.SURFACE:
        # psi = 0 solved for the coolant temperature; psi falls with the surface's rate.
        rest = domain.chain_value(surface_K, core_gap, 0.0) - domain.chain_reserve_K_per_s
        coolant_gap = rest / domain.surface_rate(0.0, 1.0)
    else:
        surface_K = rng.uniform(low.surface_K, high.surface_K - 15.0, samples)
        core_gap = np.zeros(samples)
        coolant_gap = np.zeros(samples)
    core_K, coolant_K = surface_K + core_gap, surface_K - coolant_gap
    inside = (core_K <= limits.max_core_temperature_K) & (coolant_K >= box.coolant_temperature_K[0])
    inside &= (coolant_K <= box.coolant_temperature_K[1]) & (surface_K >= low.surface_K)
    # The chain must hold at the surface disturbance that the simulation starts with.
    inside &= domain.chain_value(surface_K, core_gap, coolant_gap) >= (
        domain.chain_reserve_K_per_s - 1e-12
        if barrier is Barrier.SURFACE
        else 2.0 * domain.preset.uncertainty.surface_K_per_s
    )
    for flow in domain.flows:
        inside &= flow.rate(core_gap, coolant_gap) <= flow.largest
    return (
        CellState(soc[inside], core_K[inside], surface_K[inside], coolant_K[inside]),
        cooling_W[inside],
    )


def _favourable_errors(condition: Condition, errors: ReadingErrors) -> ReadingErrors:
    slope = weights(condition)
    return ReadingErrors(
        float(np.sign(slope.surface)) * errors.surface_K,
        float(np.sign(slope.coolant)) * errors.coolant_K,
        float(np.sign(condition.cooling)) * errors.cooling_W,
    )
