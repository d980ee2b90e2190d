"""The charger supplies what is commanded and stops when commands stop."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import InputError
from bms.presets import load_preset
from hil_sim.plant.charger import Charger

PRESET = load_preset("paper_calibrated")
REFERENCE_A = PRESET.limits.reference_current_A


def play_lagging(commands, tolerance=0.0, lag_s=0.0):
    charger = Charger(PRESET, tolerance=tolerance, lag_s=lag_s)
    return [charger.current_A(command) for command in commands]


def play(commands, delay_periods=0, preset=PRESET):
    charger = Charger(preset, delay_periods)
    return [charger.current_A(command) for command in commands]


@given(st.lists(st.none() | st.floats(-100, 100), max_size=30), st.integers(0, 1))
def test_current_never_leaves_the_range_between_reference_and_zero(commands, delay):
    assert all(REFERENCE_A <= current <= 0.0 for current in play(commands, delay))


@given(st.lists(st.floats(REFERENCE_A, 0.0), max_size=30))
def test_every_command_within_the_range_is_obeyed_at_once(commands):
    assert play(commands) == commands


def test_a_delayed_charger_obeys_one_period_later():
    assert play([-1.0, -2.0, -3.0], delay_periods=1) == [0.0, -1.0, -2.0]


def test_one_missing_command_is_bridged_and_the_second_stops_the_current():
    assert play([-5.0, None, None, None, -4.0]) == [-5.0, -5.0, 0.0, 0.0, -4.0]


def test_a_delayed_charger_has_no_reserve_left_to_bridge():
    assert play([-5.0, None, -4.0, -4.0], delay_periods=1) == [0.0, -5.0, 0.0, -4.0]


def test_silence_from_the_start_means_no_current():
    assert play([None] * 3) == [0.0] * 3


@given(st.lists(st.none() | st.floats(REFERENCE_A, -1.0), max_size=40), st.integers(0, 1))
def test_no_command_acts_longer_than_the_margins_cover(commands, delay):
    """At the end of any period with current, the measurement behind it is at most T + delay old."""
    covered_periods = round(
        (PRESET.timing.sampling_period_s + PRESET.timing.delay_s) / PRESET.timing.sampling_period_s
    )
    last_seen = None
    for now, current in enumerate(play(commands, delay)):
        arrived = now - delay
        if arrived >= 0 and commands[arrived] is not None:
            last_seen = arrived
        if current != 0.0:
            assert last_seen is not None
            assert now + 1 - last_seen <= covered_periods


@pytest.mark.parametrize("delay", [-1, 2])
def test_a_delay_beyond_what_the_preset_covers_is_refused(delay):
    with pytest.raises(InputError, match=r"timing\.delay_s"):
        Charger(PRESET, delay)


def test_a_preset_without_delay_stops_at_the_first_missing_command():
    strict = replace(PRESET, timing=replace(PRESET.timing, delay_s=0.0))
    assert play([-5.0, None], preset=strict) == [-5.0, 0.0]


@pytest.mark.parametrize("tolerance", [-0.05, 0.05])
def test_a_charger_with_a_tolerance_supplies_that_much_more_or_less(tolerance):
    assert play_lagging([-10.0, -20.0], tolerance) == [
        -10.0 * (1 + tolerance),
        -20.0 * (1 + tolerance),
    ]


def test_a_lagging_charger_follows_as_a_low_pass_of_first_order():
    """After a step the current is that of 1 - exp(-t/lag) at the end of each period."""
    period_s, lag_s = PRESET.timing.sampling_period_s, 1.0
    currents_A = play_lagging([-20.0] * 50, lag_s=lag_s)
    expected_A = [-20.0 * (1.0 - math.exp(-(k + 1) * period_s / lag_s)) for k in range(50)]
    assert currents_A == pytest.approx(expected_A, rel=1e-12)


def test_a_lagging_charger_without_commands_dies_away():
    currents_A = play_lagging([-20.0] * 100 + [None] * 100, lag_s=0.5)
    assert currents_A[99] == pytest.approx(-20.0)
    assert currents_A[101] == pytest.approx(-20.0 * math.exp(-0.2), rel=1e-6)
    assert abs(currents_A[-1]) < 1e-6
