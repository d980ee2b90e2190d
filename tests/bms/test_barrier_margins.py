"""The margins cover what happens between samples: nothing falls by more, and little by less."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from bms.barrier import barrier_constants, sampling_margins
from bms.barrier.constraints import charging_current_A, left_hand_sides
from bms.barrier.rates import Weights, heat_range_W, largest_rate
from bms.barrier.readings import soc_error_bound, soc_reserve
from bms.barrier.rounding import ROUNDINGS, UNIT, rounding_allowances
from bms.bus_signals import BusQuantisation
from bms.cell import CellState, Disturbance, integrate_step, rates, terminal_voltage_V
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.schema import Uncertainty

RUNS = 60
BUS = BusQuantisation()
WEIGHTS = (
    Weights(1.0, 0.0, 0.0),
    Weights(-1.0, 0.0, 0.0),
    Weights(0.0, 1.0, 0.0),
    Weights(0.0, -1.0, 0.0),
    Weights(0.0, 0.0, 1.0),
    Weights(0.0, 0.0, -1.0),
    Weights(-0.3, 0.5, -0.2),
    Weights(0.4, -0.1, -0.6),
)


@pytest.fixture(params=one_cell_preset_names())
def preset(request):
    return load_preset(request.param)


class BangBang:
    """Inputs that jump between the ends of their range, each run at its own random pace."""

    def __init__(self, random, low, high, pace_s):
        self.random, self.low, self.high = random, low, high
        self.pace_s = pace_s
        self.is_high = random.random(len(pace_s)) < 0.5

    def after(self, step_s):
        jumps = self.random.random(len(self.pace_s)) < step_s / self.pace_s
        self.is_high = self.is_high ^ jumps
        return np.where(self.is_high, self.high, self.low)


def rest(random, preset, warmest_K=312.0):
    start_K = random.uniform(preset.initial.temperature_K, warmest_K, RUNS)
    return CellState(np.full(RUNS, 0.0), start_K, start_K, start_K)


def bang_bang_inputs(random, preset):
    """Current, cooling power and the three thermal disturbances, paces from 0.3 s to 300 s."""

    def source(low, high):
        return BangBang(random, low, high, np.exp(random.uniform(-1.0, 5.7, RUNS)))

    bounds = preset.uncertainty
    return [
        source(preset.limits.reference_current_A, 0.0),
        source(0.0, preset.operating_box.cooling_power_W[1]),
        *(
            source(-bound, bound)
            for bound in (bounds.core_K_per_s, bounds.surface_K_per_s, bounds.coolant_K_per_s)
        ),
    ]


def test_no_charge_changes_temperatures_faster_than_the_bound(preset):
    random = np.random.default_rng(7)
    state, inputs, step_s = rest(random, preset), bang_bang_inputs(random, preset), 0.25
    bounds = [largest_rate(preset.cell, preset, weights) for weights in WEIGHTS]
    largest = np.full(len(WEIGHTS), -np.inf)
    for _ in range(4000):
        current_A, cooling_W, *nu = (source.after(step_s) for source in inputs)
        hot = state.core_temperature_K > preset.limits.max_core_temperature_K - 1.0
        current_A = np.where(hot, 0.0, current_A)
        disturbance = Disturbance(0.0, *nu)
        temperature_rates = rates(preset.cell, state, current_A, cooling_W, disturbance)[1:]
        largest = np.maximum(
            largest,
            [np.max(sum(w * r for w, r in zip(weights, temperature_rates))) for weights in WEIGHTS],
        )
        state = integrate_step(preset.cell, state, current_A, cooling_W, step_s, disturbance)
    assert np.all(largest <= bounds)
    assert np.all(largest >= 0.3 * np.array(bounds)), "the charges hardly move"


LONG_S, FINE_S = 4000.0, 0.5


@cache
def step_responses(name):
    """Rates of the three temperatures after a step from rest, of full current and of full cooling.

    Without disturbances and reversible heat the model is linear in heat and cooling power.
    """
    preset = load_preset(name)
    cell = replace(preset.cell, entropic_coefficient_V_per_K=0.0)
    currents_A = np.array([preset.limits.reference_current_A, 0.0])
    cooling_W = np.array([0.0, preset.operating_box.cooling_power_W[1]])
    start_K = np.full(2, 300.0)
    state, responses = CellState(np.zeros(2), start_K, start_K, start_K), []
    for _ in range(round(LONG_S / FINE_S)):
        responses.append(rates(cell, state, currents_A, cooling_W)[1:])
        state = integrate_step(cell, state, currents_A, cooling_W, FINE_S)
    return cell, np.array(responses)


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_the_rate_bound_is_attained_by_some_history_of_inputs(preset, weights):
    """Each input at one end for long, at one end for a time t*, at one end now: the worst."""
    cell, responses = step_responses(preset.name)
    quiet = replace(preset, uncertainty=Uncertainty(0.0, 0.0, 0.0, 0.0, 0.0))
    total = 0.0
    for response in np.moveaxis(responses, 2, 0):
        step = response @ np.array(weights)
        worst = (early * (step[-1] - step) + late * (step - step[0]) + now * step[0]
                 for early, late, now in product((0.0, 1.0), repeat=3))  # fmt: skip
        total += max(np.max(rate) for rate in worst)
    bound = largest_rate(cell, quiet, weights)
    assert 0.99 * bound <= total <= bound * (1 + 1e-9)


@pytest.mark.parametrize("entropy_V_per_K", [-4.6e-4, -1e-5, 0.0, 4.6e-4])
def test_heat_range_holds_every_heat_of_charging(preset, entropy_V_per_K):
    cell = replace(preset.cell, entropic_coefficient_V_per_K=entropy_V_per_K)
    low_W, high_W = heat_range_W(cell, preset)
    current_A = np.linspace(preset.limits.reference_current_A, 0.0, 2001)
    for core_K in (275.0, preset.limits.max_core_temperature_K):
        heat_W = cell.ohmic_resistance_ohm * current_A**2 - entropy_V_per_K * core_K * current_A
        assert low_W <= np.min(heat_W) + 1e-12 and np.max(heat_W) <= high_W + 1e-12
    hottest_W = cell.ohmic_resistance_ohm * current_A**2 - (
        entropy_V_per_K * preset.limits.max_core_temperature_K * current_A
    )
    assert low_W == pytest.approx(np.min(hottest_W), abs=1e-6)


def reading(random, preset, state):
    """The state that decides: every channel off by its bound either way, the charge at its most."""

    def off(sensor, bus_step):
        return random.choice([-1.0, 1.0], RUNS) * (sensor.error_bound + bus_step)

    sensors = preset.sensors
    return (
        CellState(
            state.soc
            + random.choice([-1.0, 1.0], RUNS) * soc_error_bound(preset.cell, preset, BUS)
            + soc_reserve(preset.cell, preset),
            state.core_temperature_K,
            state.surface_temperature_K
            + off(sensors.surface_temperature_K, BUS.surface_temperature_K),
            state.coolant_temperature_K
            + off(sensors.coolant_temperature_K, BUS.coolant_temperature_K),
        ),
        off(sensors.cooling_power_W, BUS.cooling_power_W),
    )


def test_no_left_hand_side_falls_by_more_than_its_margin_until_the_next_command(preset):
    """SoC, core and surface, at the command in force, from the reading to one delay and hold."""
    random = np.random.default_rng(8)
    cell, timing = preset.cell, preset.timing
    constants, margins = barrier_constants(cell, preset), sampling_margins(cell, preset)
    state, inputs = rest(random, preset), bang_bang_inputs(random, preset)
    sub_steps = 2
    step_s = timing.sampling_period_s / sub_steps
    delay_steps = round(timing.delay_s / step_s)
    largest_fall = np.full(3, -np.inf)
    command_A = np.zeros(RUNS)
    for _ in range(2500):
        old_A, (command_A, cooling_W, *nu) = (
            command_A,
            (source.after(timing.sampling_period_s) for source in inputs),
        )
        hot = state.core_temperature_K > preset.limits.max_core_temperature_K - 1.0
        command_A = np.where(hot, 0.0, command_A)
        seen, cooling_error_W = reading(random, preset, state)
        decided = left_hand_sides(
            cell, preset, constants, seen, cooling_W + cooling_error_W, command_A
        )
        later = state
        for step in range(delay_steps + sub_steps):
            acting_A = old_A if step < delay_steps else command_A
            later = integrate_step(cell, later, acting_A, cooling_W, step_s, Disturbance(0.0, *nu))
            now = left_hand_sides(cell, preset, constants, later, cooling_W, command_A)
            fall = [np.max(before - after) for before, after in zip(decided[1:], now[1:])]
            largest_fall = np.maximum(largest_fall, fall)
            if step == sub_steps - 1:
                state = later
    allowed = np.array([margins.soc_per_s, margins.core_K_per_s, margins.surface_K_per_s2])
    assert np.all(largest_fall <= allowed * (1 + 1e-9))
    assert np.all(largest_fall >= 0.3 * allowed), "the charges hardly move"


def test_the_voltage_stays_below_its_limit_until_the_next_command(preset):
    """At the strongest current that the margin leaves, however the counted charge may be off."""
    cell, limits, timing = preset.cell, preset.limits, preset.timing
    margin_V = sampling_margins(cell, preset).voltage_V
    error = soc_error_bound(cell, preset, BUS)
    true_soc = np.linspace(0.0, limits.completion_soc, 20_001)
    charged = (
        -limits.reference_current_A * (timing.sampling_period_s + timing.delay_s) / cell.capacity_As
    )
    for counted_soc in (true_soc - error, true_soc + error):
        deciding_soc = counted_soc + soc_reserve(cell, preset)
        spare_V = limits.max_voltage_V - cell.ocv(deciding_soc) - margin_V
        current_A = np.maximum(-spare_V / cell.ohmic_resistance_ohm, limits.reference_current_A)
        voltage_V = terminal_voltage_V(cell, true_soc + charged, np.minimum(current_A, 0.0))
        assert np.max(voltage_V) <= limits.max_voltage_V


def closed_loop(preset, margins, error_bound_K, seed):
    """Smallest distance to each limit (V, -, K, K) in charges with everything at its bound."""
    random = np.random.default_rng(seed)
    cell, limits, timing = preset.cell, preset.limits, preset.timing
    constants = barrier_constants(cell, preset)
    state, (_, cooling, *nu) = rest(random, preset, 318.0), bang_bang_inputs(random, preset)
    state = state._replace(soc=random.uniform(0.0, 0.7, RUNS))
    sub_steps = 10
    step_s = timing.sampling_period_s / sub_steps
    assert timing.delay_s == timing.sampling_period_s
    before = [np.zeros(RUNS)] * 3
    command_A = np.zeros(RUNS)
    nearest = np.full(4, np.inf)
    for _ in range(2500):
        cooling_W = cooling.after(timing.sampling_period_s)
        seen, cooling_error_W = reading(random, preset, state)
        error_K = random.choice([-1.0, 1.0], RUNS) * error_bound_K
        seen = seen._replace(core_temperature_K=seen.core_temperature_K + error_K)
        acting_A, command_A = (
            command_A,
            charging_current_A(
                cell, preset, constants, margins, seen, cooling_W + cooling_error_W, error_bound_K
            ),
        )
        acting_A = np.where(state.soc >= limits.completion_soc, 0.0, acting_A)
        after = [source.after(timing.sampling_period_s) for source in nu]
        for sub_step in range(sub_steps):
            # The surface disturbance may not jump; a tenth of a period is slow enough for it.
            ends = (before, after) if sub_step == 0 else (after, after)
            state = integrate_step(
                cell, state, acting_A, cooling_W, step_s, *(Disturbance(0.0, *end) for end in ends)
            )
            nearest = np.minimum(
                nearest,
                [
                    np.min(limits.max_voltage_V - terminal_voltage_V(cell, state.soc, acting_A)),
                    np.min(limits.max_soc - state.soc),
                    np.min(limits.max_core_temperature_K - state.core_temperature_K),
                    np.min(limits.max_surface_temperature_K - state.surface_temperature_K),
                ],
            )
        before = after
    return nearest


@pytest.mark.parametrize("error_bound_K", [0.0, 0.5])
def test_no_limit_is_passed_between_samples_with_everything_at_its_bound(preset, error_bound_K):
    margins = sampling_margins(preset.cell, preset)
    nearest = closed_loop(preset, margins, error_bound_K, seed=9)
    assert np.all(nearest >= 0.0)
    assert nearest[2] < 1.0, "the core's limit was never near"


def test_margins_grow_with_period_delay_and_sensor_errors(preset):
    margins = sampling_margins(preset.cell, preset)
    coarse = replace(preset.sensors.surface_temperature_K, resolution=1.0)
    for changed in (
        replace(preset, timing=replace(preset.timing, sampling_period_s=1.0)),
        replace(preset, timing=replace(preset.timing, delay_s=1.0)),
        replace(preset, sensors=replace(preset.sensors, surface_temperature_K=coarse)),
    ):
        larger = sampling_margins(preset.cell, changed)
        assert larger.core_K_per_s > margins.core_K_per_s
        assert larger.surface_K_per_s2 > margins.surface_K_per_s2


def test_with_no_time_and_perfect_sensors_only_arithmetic_needs_a_margin(preset):
    perfect = {name: replace(sensor, resolution=0.0, noise_std=0.0, bias=0.0)
               for name, sensor in vars(preset.sensors).items()}  # fmt: skip
    ideal = replace(
        preset,
        timing=replace(preset.timing, sampling_period_s=1e-12, delay_s=0.0),
        sensors=replace(preset.sensors, **perfect),
    )
    margins = sampling_margins(preset.cell, ideal, BusQuantisation(*[0.0] * 7))
    rounding = rounding_allowances(preset.cell, preset)
    assert margins.core_K_per_s == pytest.approx(rounding.core_K_per_s, abs=1e-10)
    assert margins.surface_K_per_s2 == pytest.approx(rounding.surface_K_per_s2, abs=1e-10)
    counting = ROUNDINGS * UNIT
    assert margins.soc_per_s == pytest.approx(rounding.soc_per_s, abs=1e-12)
    steepest_V = np.max(np.diff(preset.cell.ocv.voltage_V) / np.diff(preset.cell.ocv.soc))
    assert rounding.voltage_V < margins.voltage_V < rounding.voltage_V + 1.5 * steepest_V * counting
