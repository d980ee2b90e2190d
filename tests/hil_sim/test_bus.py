"""Buses are opened by name and carry classical 11-bit data frames."""

import contextlib

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import BusError, InputError
from hil_sim.bus.buses import (
    Frame,
    ecu_remedy,
    is_serial_line,
    open_bus,
    require_room_for_ecu,
    require_shared,
)
from hil_sim.bus.frame import frames_of


@pytest.fixture
def pair(request):
    name = f"virtual:{request.node.name}"
    with open_bus(name) as one, open_bus(name) as other:
        yield one, other


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=20))
def test_frames_arrive_whole_and_in_order(frames):
    with open_bus("virtual:order") as one, open_bus("virtual:order") as other:
        for frame in frames:
            one.send(Frame(*frame))
        assert [other.receive(1.0) for _ in frames] == frames
        assert other.receive(0.0) is None
        assert one.receive(0.0) is None


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=20))
def test_frames_of_pairs_are_frames_like_others(pairs):
    made = frames_of(pairs)
    assert made == [Frame(*pair) for pair in pairs]
    assert all(type(frame) is Frame and frame.data == pair[1] for frame, pair in zip(made, pairs))


@pytest.mark.parametrize(
    "foreign",
    [
        can.Message(arbitration_id=0x100, is_extended_id=True, data=[1]),
        can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True, dlc=4),
        can.Message(arbitration_id=0x100, is_error_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x100, is_extended_id=False, is_fd=True, data=[1] * 12),
    ],
    ids=["extended", "remote", "error", "fd"],
)
def test_other_kinds_of_frames_are_not_taken_for_data(pair, foreign, request):
    one, other = pair
    with can.Bus(interface="virtual", channel=request.node.name) as third:
        third.send(foreign)
    one.send(Frame(0x200, b"after"))
    assert other.receive(1.0) == Frame(0x200, b"after")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("vcan0", "virtual:bms"),
        ("virtual:", "virtual:bms"),
        (":bms", "virtual:bms"),
        ("", "virtual:bms"),
        ("nonsense:x", "nonsense"),
        ("slcan:/dev/does-not-exist", "virtual:bms"),
        ("socketcan:not_there9", "vcan_guest.sh"),
        ("socketcan:not_there9", "virtual:bms"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_one_line_with_a_remedy(name, said):
    with pytest.raises(BusError, match=said) as caught:
        open_bus(name)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_an_adapter_is_on_a_bus_with_others_and_a_socket_is_a_line_with_two_ends():
    assert is_serial_line("slcan:socket://127.0.0.1:5000")
    assert not is_serial_line("slcan:/dev/ttyACM0")
    assert ecu_remedy("slcan:/dev/ttyACM0") == "start 'bms ecu --bus slcan:/dev/ttyACM0'"
    for name in ("slcan:/dev/ttyACM0", "slcan:socket://127.0.0.1:5000"):
        with pytest.raises(InputError, match=r"use .*'bms plant --bus BUS'"):
            require_room_for_ecu(name)
    require_room_for_ecu("socketcan:vcan0")


def test_a_virtual_bus_is_no_bus_for_two_processes():
    require_shared("socketcan:vcan0")
    with pytest.raises(InputError, match="bms sil"):
        require_shared("virtual:bms")


@pytest.mark.parametrize(
    ("group", "neighbour"),
    [("239.74.166.1", "239.74.166.2"), ("ff15:7079:7468:6f6e::1", "ff15:7079:7468:6f6e::2")],
)
def test_a_multicast_bus_hears_its_own_group_alone(group, neighbour):
    """Also where another program on the machine has joined the other one."""
    with contextlib.ExitStack() as buses:
        one, other, stranger = (
            buses.enter_context(open_bus(f"udp_multicast:{name}"))
            for name in (group, group, neighbour)
        )
        stranger.send(Frame(0x100, b"stranger"))
        one.send(Frame(0x200, b"own"))
        assert other.receive(1.0) == Frame(0x200, b"own")
        assert other.receive(0.1) is None
