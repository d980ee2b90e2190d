"""Encoding and decoding of frames; the oracle is cantools with its AUTOSAR functions."""

import math
from importlib.resources import files

import cantools
import pytest
from cantools import autosar
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus import catalog
from hil_sim.bus.database import load_codecs
from hil_sim.bus.e2e import Receiver, Sender

ORACLE = cantools.database.load_string(files("codegen").joinpath("can/bms.dbc").read_text(), "dbc")
CODECS = load_codecs()
PROTECTED = [name for name, codec in CODECS.items() if codec.data_ids]
ANALOGUE = [
    (message.name, signal.name)
    for message in ORACLE.messages
    for signal in message.signals
    if signal.scale != 1
]


def signal_of(message, name):
    return ORACLE.get_message_by_name(message).get_signal_by_name(name)


@st.composite
def message_values(draw, names=tuple(CODECS)):
    """A message and values on the grid of each of its signals."""
    name = draw(st.sampled_from(names))
    values = {}
    for signal_name in CODECS[name].signal_names:
        signal = signal_of(name, signal_name)
        highest = round((signal.maximum - signal.offset) / signal.scale)
        raw = draw(st.integers(0, highest))
        values[signal_name] = raw * signal.scale + signal.offset
    return name, values


def test_catalog_has_every_message_under_its_name_and_identifier():
    ids = {getattr(catalog.Message, entry.name): entry.value for entry in catalog.FrameId}
    assert ids == {message.name: message.frame_id for message in ORACLE.messages}


@pytest.mark.parametrize(
    ("message", "signal", "table"),
    [
        ("ChargeRequest", "Request", catalog.Request),
        ("ChargeCommand", "CommandState", catalog.CommandState),
        ("Diagnostics", "DiagnosticState", catalog.CommandState),
        ("Diagnostics", "FirstFault", catalog.FirstFault),
        ("Decision", "ActiveConstraint", catalog.ActiveConstraint),
        ("NetworkDiagnostics", "ReportedState", catalog.ReportedState),
    ],
)
def test_catalog_has_every_named_value_with_its_number(message, signal, table):
    names = {n: str(name) for n, name in signal_of(message, signal).choices.items()}
    assert {entry.value: entry.name.replace("_", "").lower() for entry in table} == {
        n: name.lower() for n, name in names.items()
    }


@given(message_values(), st.integers(0, 15))
def test_payload_is_the_one_of_cantools(name_and_values, counter):
    name, values = name_and_values
    message, data = ORACLE.get_message_by_name(name), CODECS[name].encode(values, counter)
    if name in PROTECTED:
        data_id = CODECS[name].data_ids[counter]
        assert autosar.check_profile2_crc(data, data_id)
        values = {**values, f"{name}Crc": data[0], f"{name}Counter": counter}
    assert data == message.encode(values, strict=False)


@given(message_values(), st.integers(0, 15))
def test_decoding_gives_back_what_was_encoded(name_and_values, counter):
    name, values = name_and_values
    decoded = CODECS[name].decode(CODECS[name].encode(values, counter))
    assert decoded == pytest.approx(values, abs=1e-9)


@pytest.mark.parametrize(("message", "name"), ANALOGUE)
@pytest.mark.parametrize("beyond", [1e-3, 1.0, 1e9, math.inf])
def test_a_value_beyond_the_range_is_sent_as_the_end_of_the_range(message, name, beyond):
    signal, codec = signal_of(message, name), CODECS[message]
    low, high = (
        codec.decode(codec.encode({name: value}))[name]
        for value in (signal.minimum - beyond, signal.maximum + beyond)
    )
    assert (low, high) == pytest.approx((signal.minimum, signal.maximum))


@pytest.mark.parametrize(("message", "name"), ANALOGUE)
@pytest.mark.parametrize("missing", [None, math.nan])
def test_an_unavailable_value_is_all_ones_on_the_bus_and_none_in_python(message, name, missing):
    signal, codec = signal_of(message, name), CODECS[message]
    data = codec.encode({name: missing})
    raw = ORACLE.get_message_by_name(message).decode(data, scaling=False, decode_choices=False)
    assert raw[name] == 2**signal.length - 1
    assert codec.decode(data)[name] is None


@given(message_values(tuple(PROTECTED)), st.integers(0, 15), st.data())
def test_a_frame_with_any_byte_changed_is_refused(name_and_values, counter, data):
    """Any change within a byte, but for the counter, which also selects the data id."""
    name, values = name_and_values
    payload = bytearray(CODECS[name].encode(values, counter))
    index = data.draw(st.integers(0, len(payload) - 1))
    change = data.draw(st.integers(1, 15)) << 4 if index == 1 else data.draw(st.integers(1, 255))
    payload[index] ^= change
    assert CODECS[name].decode(bytes(payload)) is None


@pytest.mark.parametrize("name", PROTECTED)
def test_a_frame_of_wrong_length_is_refused(name):
    payload = CODECS[name].encode({})
    assert CODECS[name].decode(payload) is not None
    assert CODECS[name].decode(payload[:-1]) is None
    assert CODECS[name].decode(payload + b"\0") is None
    assert CODECS[name].decode(b"") is None


@pytest.mark.parametrize("name", PROTECTED)
def test_one_message_does_not_pass_for_another(name):
    payload = CODECS[name].encode({})
    for other in PROTECTED:
        if other != name and CODECS[other].length == len(payload):
            assert CODECS[other].decode(payload) is None


def test_a_sender_counts_modulo_16():
    sender = Sender(CODECS["Coolant"])
    frames = [sender.frame({"CoolingPower": 1.0}) for _ in range(18)]
    assert [frame.data[1] & 0xF for frame in frames] == [*range(16), 0, 1]
    assert {frame.frame_id for frame in frames} == {0x102}


def test_a_receiver_takes_new_frames_only_and_bridges_lost_ones():
    sender, receiver = Sender(CODECS["ChargeCommand"]), Receiver(CODECS["ChargeCommand"])
    first, _lost, third = (sender.frame({"CommandCurrent": -float(n)}) for n in range(3))
    assert receiver.accept(first.data)["CommandCurrent"] == pytest.approx(0.0)
    assert receiver.accept(first.data) is None
    assert receiver.accept(third.data)["CommandCurrent"] == pytest.approx(-2.0)
