"""Plant's frames in C: those of the CAN database by cantools, and what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import COUNTER_MODULUS, load_codecs
from hil_sim.bus.wire import Decoder, Listener, Publisher

CODECS = load_codecs()
PROTECTED = [codec for codec in CODECS.values() if codec.data_ids]
WITH_CONTENT = [codec for codec in CODECS.values() if codec.signals]
each_message = pytest.mark.parametrize("codec", WITH_CONTENT, ids=lambda codec: codec.name)


def ends(signal):
    """Both ends of the range, half a step beside each step near them, and far outside."""
    for raw in (signal.lowest, signal.lowest + 1, signal.highest - 1, signal.highest):
        for beside in (-0.5, -0.25, 0.0, 0.5):
            yield (raw + signal.offset_steps + beside) * signal.scale
    yield from (-1e12, 1e12, None, math.nan)


def some(codec, draw):
    return [
        draw(st.one_of(st.sampled_from(list(ends(s))), st.floats(-2000.0, 2000.0)))
        for s in codec.signals
    ]


def by_name(codec, values):
    return dict(zip([signal.name for signal in codec.signals], values))


def said(values):
    return [None if math.isnan(value) else value for value in values]


@each_message
@given(st.data())
def test_a_frame_is_that_of_cantools(codec, data):
    rows = [some(codec, data.draw) for _ in range(3)]
    publisher = Publisher([codec])
    sent = [publisher.frames(row, 1)[0] for row in rows]
    assert sent == [
        Frame(codec.frame_id, codec.encode(by_name(codec, row), counter))
        for counter, row in enumerate(rows)
    ]


@each_message
@given(st.data())
def test_what_is_read_of_a_frame_is_what_cantools_reads(codec, data):
    payload = codec.encode(by_name(codec, some(codec, data.draw)), data.draw(st.integers(0, 15)))
    decoder = Decoder(codec)
    assert decoder.is_intact(payload)
    assert by_name(codec, said(decoder.values(payload))) == codec.decode(payload)


@each_message
@given(data=st.data(), payload=st.binary(max_size=8))
def test_random_bytes_are_judged_and_read_as_by_cantools(codec, data, payload):
    """Raw values above the range among them, which carry nothing."""
    if codec.data_ids and len(payload) == codec.length and data.draw(st.booleans()):
        bits = codec.encode({}, payload[1] % COUNTER_MODULUS)
        payload = bits[:1] + payload[1:]
    decoder = Decoder(codec)
    assert decoder.is_intact(payload) == codec.is_intact(payload)
    if codec.is_intact(payload):
        assert by_name(codec, said(decoder.values(payload))) == codec.decode(payload)


def test_counters_run_around_and_a_message_left_out_keeps_its_own():
    first, second = CODECS["Coolant"], CODECS["ChargeMode"]
    publisher = Publisher([first, second])
    both = [publisher.frames([1.0, 0.0, 60.0], 2) for _ in range(20)]
    assert [frame.data[1] % 16 for frame, _ in both] == [n % 16 for n in range(20)]
    (alone,) = publisher.frames([1.0], 1)
    assert alone.data[1] % 16 == 4
    after, late = publisher.frames([1.0, 0.0, 60.0], 2)
    assert (after.data[1] % 16, late.data[1] % 16) == (5, 4)


def frame(name, counter, **values):
    codec = CODECS[name]
    return Frame(codec.frame_id, codec.encode(values, counter))


def heard(listener, *frames):
    values = listener.hear(frames)
    return {
        name: values[place]
        for name, place in listener.places.items()
        if not math.isnan(values[place])
    }


def test_a_listener_forgets_what_was_said_in_the_period_before():
    listener = Listener([CODECS["Estimate"], CODECS["Plan"]])
    assert heard(listener, frame("Estimate", 3, ErrorBound=0.5))["ErrorBound"] == 0.5
    assert heard(listener) == {}


def test_of_two_frames_of_a_message_the_later_counts():
    listener = Listener([CODECS["Estimate"]])
    two = frame("Estimate", 3, ErrorBound=0.5), frame("Estimate", 4, StateOfCharge=0.25)
    values = heard(listener, *two)
    assert (values.get("ErrorBound"), values["StateOfCharge"]) == (None, 0.25)


def test_a_frame_that_repeats_the_counter_of_the_last_one_is_refused():
    listener = Listener([CODECS["Estimate"]])
    assert heard(listener, frame("Estimate", 0, ErrorBound=0.5))
    assert heard(listener, frame("Estimate", 0, ErrorBound=0.75)) == {}
    assert heard(listener, frame("Estimate", 9, ErrorBound=0.75))


def test_a_message_without_protection_has_no_counter_to_repeat():
    listener = Listener([CODECS["Identity"]])
    identity = frame("Identity", 0, ModelHash=0xFFFFFFFF, FirmwareVersion=7)
    assert heard(listener, identity) == heard(listener, identity)
    assert heard(listener, identity)["ModelHash"] == 0xFFFFFFFF


@pytest.mark.parametrize("codec", PROTECTED, ids=lambda codec: codec.name)
def test_no_single_bit_and_no_other_length_is_taken_for_a_frame(codec):
    good = codec.encode({}, 5)
    decoder, listener = Decoder(codec), Listener([codec])
    wrong = [good[:-1], good + b"\0", b""]
    for bit in range(8 * len(good)):
        flipped = bytearray(good)
        flipped[bit // 8] ^= 1 << bit % 8
        wrong.append(bytes(flipped))
    for payload in wrong:
        assert not decoder.is_intact(payload)
        assert heard(listener, Frame(codec.frame_id, payload)) == {}


def test_frames_of_others_and_such_that_are_too_long_are_passed_over():
    listener = Listener([CODECS["Estimate"]])
    own = frame("Estimate", 1, ErrorBound=0.5)
    others = Frame(0x7FF, b"\x01"), Frame(own.frame_id, bytes(12)), Frame(0x080, b"")
    assert heard(listener, others[0], own, *others[1:])["ErrorBound"] == 0.5
