"""Physical values on the bus: the codec in C against cantools for every signal with a unit."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.bus_signals import BUS, RANGES, BusQuantisation
from bms.firmware._firmware import ffi, lib
from codegen.can_database import load_database
from codegen.can_sources import can_sources

DATABASE = load_database()
SIGNALS = {s.name: s for m in DATABASE.messages for s in m.signals if s.unit}
NAMES = st.sampled_from(sorted(SIGNALS))
ZERO_CURRENT = 524288
SINGLE_PRECISION = 1.5e-7
"""Relative error of a float32 quotient, whose divisor is rounded too."""


def in_c(name: str) -> object:
    signal = SIGNALS[name]
    steps = round(signal.offset / signal.scale)
    return ffi.new(
        "codec_signal_t *",
        {"scale": signal.scale, "offset_steps": steps, "raw_max": 2**signal.length - 3},
    )


@given(name=NAMES, share=st.floats(0, 1))
def test_nearest_code_is_that_of_cantools(name: str, share: float) -> None:
    signal = SIGNALS[name]
    value = signal.minimum + share * (signal.maximum - signal.minimum)
    raw = lib.codec_encode(in_c(name), value, lib.CODEC_NEAREST)
    exact = (value - signal.offset) / signal.scale
    assert abs(raw - exact) <= 0.5 + 0.02
    assert lib.codec_decode(in_c(name), raw) == pytest.approx(
        signal.offset + raw * signal.scale, rel=1e-6, abs=1e-5
    )


@given(name=NAMES, raw=st.integers(0, 0xFFFFF))
def test_every_code_survives_decode_and_encode(name: str, raw: int) -> None:
    raw %= 2 ** SIGNALS[name].length
    value = lib.codec_decode(in_c(name), raw)
    if raw > 2 ** SIGNALS[name].length - 3:
        assert math.isnan(value)
    else:
        assert lib.codec_encode(in_c(name), value, lib.CODEC_NEAREST) == raw


@given(name=NAMES, value=st.floats(allow_nan=False, width=32))
def test_values_beyond_the_range_saturate(name: str, value: float) -> None:
    signal = SIGNALS[name]
    raw = lib.codec_encode(in_c(name), value, lib.CODEC_NEAREST)
    if math.isinf(value):
        assert raw == 2**signal.length - 1
    elif value < signal.minimum:
        assert raw == 0
    elif value > signal.maximum:
        assert raw == 2**signal.length - 3


@pytest.mark.parametrize("name", sorted(SIGNALS))
def test_what_is_not_a_number_is_sent_as_all_ones(name: str) -> None:
    raw = lib.codec_encode(in_c(name), math.nan, lib.CODEC_NEAREST)
    assert raw == 2 ** SIGNALS[name].length - 1


@given(value=st.floats(-65, 65, width=32) | st.floats(-1048.5, 1048.5, width=32))
def test_rounding_towards_zero_never_asks_for_more_current(value: float) -> None:
    raw = lib.codec_encode(in_c("CommandCurrent"), value, lib.CODEC_TOWARDS_ZERO)
    sent = (raw - ZERO_CURRENT) * 0.002
    slack_A = max(1e-5, SINGLE_PRECISION * abs(value))
    assert abs(sent) <= abs(value) + BUS.command_A
    assert abs(sent - value) < 0.002 + slack_A


def test_a_command_just_short_of_a_step_gains_less_than_margins_assume() -> None:
    signal, gained_A = in_c("CommandCurrent"), []
    for step_A in -0.002 * np.arange(0, 524_200, 271):
        for missing_A in np.arange(3.6e-5, 8e-5, 2e-6):
            value = float(np.float32(step_A + missing_A))
            raw = lib.codec_encode(signal, value, lib.CODEC_TOWARDS_ZERO)
            gained_A.append(abs((raw - ZERO_CURRENT) * 0.002) - abs(value))
    assert 0.8 * BUS.command_A < max(gained_A) <= BUS.command_A


@pytest.mark.parametrize("value", [0.0, -23.0, -22.998, -0.002, -11.5, -65.0, -116.0])
def test_values_on_a_step_are_sent_as_they_are(value: float) -> None:
    raw = lib.codec_encode(in_c("CommandCurrent"), value, lib.CODEC_TOWARDS_ZERO)
    assert (raw - ZERO_CURRENT) * 0.002 == pytest.approx(value, abs=1e-9)


def test_no_current_is_exactly_that_on_the_bus_and_off_it() -> None:
    for rounding in (lib.CODEC_TOWARDS_ZERO, lib.CODEC_NEAREST):
        for zero in (0.0, -0.0):
            assert lib.codec_encode(in_c("CommandCurrent"), zero, rounding) == ZERO_CURRENT
    assert lib.codec_decode(in_c("CommandCurrent"), ZERO_CURRENT) == 0.0


def test_margins_assume_the_resolution_of_the_database() -> None:
    half_steps = BusQuantisation()
    for field, name in {
        "current_A": "Current",
        "surface_temperature_K": "SurfaceTemperature",
        "coolant_temperature_K": "CoolantTemperature",
        "cooling_power_W": "CoolingPower",
        "plug_in_soc": "PlugInStateOfCharge",
    }.items():
        assert getattr(half_steps, field) == pytest.approx(SIGNALS[name].scale / 2)


@pytest.mark.parametrize(
    ("quantity", "names"),
    {
        "current_A": [
            *("Current", "ReferenceCurrent", "CommandCurrent", "LowerCurrent", "UpperCurrent"),
        ],
        "voltage_V": ["Voltage"],
        "temperature_K": ["SurfaceTemperature", "CoolantTemperature", "CoreTemperature"],
        "cooling_power_W": ["CoolingPower"],
    }.items(),
)
def test_presets_are_held_to_the_ranges_of_the_database(quantity: str, names: list[str]) -> None:
    for name in names:
        signal = SIGNALS[name]
        assert getattr(RANGES, quantity) == (signal.minimum, signal.maximum)


def test_currents_of_500_A_fit_with_a_resolution_of_2_mA() -> None:
    low_A, high_A = RANGES.current_A
    assert low_A <= -500.0 and high_A >= 500.0
    assert 2.0 * BusQuantisation().current_A == pytest.approx(0.002)


def test_catalogue_in_c_has_the_database_s_numbers() -> None:
    text = can_sources()["can_catalog.c"]
    rows = re.findall(r"\[CAN_SIGNAL_\w+\] = \{ (\S+)f, (-?\d+), (\d+)u \}", text)
    expected = [(s.scale, s.offset, 2**s.length - 3) for s in SIGNALS.values()]
    assert len(rows) == len(expected)
    for (scale, steps, raw_max), row in zip(rows, expected):
        offset = int(steps) * float(scale)
        assert (float(scale), offset, int(raw_max)) == pytest.approx(row, rel=1e-7)
