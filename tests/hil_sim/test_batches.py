"""Buses that carry many frames at once are buses of python-can, on the same channel as others."""

import errno
import socket

import can
import pytest

from bms.errors import BusError
from bms.firmware import Ecu
from hil_sim.bus import batches
from hil_sim.bus.batches import SocketcanBatchBus, VirtualBatchBus
from hil_sim.bus.buses import CanBus, Frame, open_bus, open_interface
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.native._native import lib
from hil_sim.replay.recording import load_recording
from tests.hil_sim.golden.record import FOLDER

FRAMES = [Frame(0x100, b"\x01\x02"), Frame(0x080, b""), Frame(0x7FF, bytes(range(8)))]
CHANNEL = "batches"


def content(message):
    return message.arbitration_id, bytes(message.data)


def test_a_bus_of_python_can_hears_a_batch_as_messages_and_is_heard_between():
    with (
        open_bus(f"virtual:{CHANNEL}") as own,
        open_bus(f"virtual:{CHANNEL}") as other,
        can.Bus(CHANNEL, interface="virtual") as plain,
    ):
        own.send(*FRAMES)
        plain.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b"mid"))
        own.send(FRAMES[0])
        messages = [plain.recv(0.0) for _ in range(4)]
        assert [content(message) for message in messages] == [*FRAMES, FRAMES[0]]
        assert all(m.is_rx and not m.is_extended_id and m.channel == CHANNEL for m in messages)
        assert messages[0].timestamp <= messages[-1].timestamp
        assert plain.recv(0.0) is None
        heard = [other.receive(0.0) for _ in range(6)]
        assert heard == [*FRAMES, Frame(0x123, b"mid"), FRAMES[0], None]
        assert own.receive(0.0) == Frame(0x123, b"mid")


def test_such_a_bus_gives_a_batch_one_by_one_to_who_asks_it_as_python_can():
    with open_bus(f"virtual:{CHANNEL}") as own:
        listener = open_interface(f"virtual:{CHANNEL}")
        with listener:
            own.send(*FRAMES)
            assert [content(listener.recv(0.0)) for _ in FRAMES] == FRAMES
            assert listener.recv(0.0) is None


def test_filters_of_python_can_hold_for_batches_too():
    listener = VirtualBatchBus(CHANNEL)
    with listener, open_bus(f"virtual:{CHANNEL}") as own:
        listener.set_filters([{"can_id": 0x100, "can_mask": 0x7FF, "extended": False}])
        own.send(*FRAMES)
        assert CanBus("filtered", listener).receive(0.0) == FRAMES[0]
        assert CanBus("filtered", listener).receive(0.0) is None


def test_a_closed_bus_takes_and_gives_nothing():
    bus = open_bus(f"virtual:{CHANNEL}")
    bus.close()
    with pytest.raises(BusError, match=r"cannot send: .*closed"):
        bus.send(*FRAMES)
    with pytest.raises(BusError, match=r"cannot receive: .*closed"):
        bus.receive(0.0)


def test_gathering_ends_with_the_frame_that_is_asked_for_and_leaves_the_rest():
    with open_bus(f"virtual:{CHANNEL}") as own, open_bus(f"virtual:{CHANNEL}") as other:
        own.send(*FRAMES, *FRAMES)
        assert other.gather(0x080, lambda frame: True, 0.0, 100) == FRAMES[:2]
        assert other.gather(0x080, lambda frame: False, 0.0, 3) == [FRAMES[2], *FRAMES[:2]]
        assert other.gather(0x080, lambda frame: True, 0.0, 100) == [FRAMES[2]]


class PairedBus(SocketcanBatchBus):
    """The batches of SocketCAN over a pair of sockets, so that no CAN interface is needed."""

    def __init__(self, end):
        self._end = end
        super().__init__("pair")

    def shutdown(self):
        self._end.close()


@pytest.fixture
def pair(monkeypatch):
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)

    def opened(bus, channel, **options):
        bus.socket = bus._end

    monkeypatch.setattr(batches.SocketcanBus, "__init__", opened)
    yield PairedBus(near), far
    near.close()
    far.close()


def raw(frame_id, data=b""):
    return frame_id.to_bytes(4, "little") + bytes([len(data), 0, 0, 0]) + data.ljust(8, b"\0")


def test_a_batch_on_socketcan_is_frames_as_the_kernel_has_them(pair):
    bus, far = pair
    bus.send_frames(FRAMES)
    assert [far.recv(100) for _ in FRAMES] == [raw(*frame) for frame in FRAMES]


def test_what_waits_on_socketcan_is_heard_at_once_with_its_kinds(pair):
    bus, far = pair
    for frame in FRAMES:
        far.send(raw(*frame))
    for flag in (0x80000000, 0x40000000, 0x20000000):
        far.send(raw(flag | 0x100, b"\x01"))
    far.send((0x100).to_bytes(4, "little") + bytes([64, 0, 0, 0]) + bytes(64))
    kinds = [ForeignFrame.EXTENDED, ForeignFrame.REMOTE, ForeignFrame.ERROR, ForeignFrame.FD]
    assert bus.hear(0.0) == [*FRAMES, *kinds]
    assert bus.hear(0.0) == []
    assert bus.hear(0.01) == []
    far.send(raw(0x123))
    assert bus.hear(1.0) == [Frame(0x123, b"")]


def test_more_frames_than_a_batch_has_room_for_go_in_several(pair):
    bus, far = pair
    many = [Frame(n, b"") for n in range(lib.SOCKETCAN_BATCH_FRAMES + 3)]
    far.setblocking(False)
    heard = []
    for begin in range(0, len(many), 5):
        for frame in many[begin : begin + 5]:
            far.send(raw(*frame))
        heard += bus.hear(0.0)
    assert heard == many


@pytest.mark.parametrize("error", [errno.ENOBUFS, errno.ENETDOWN])
def test_an_error_of_the_interface_is_one_of_the_bus(pair, monkeypatch, error):
    bus, _ = pair
    monkeypatch.setattr(batches, "lib", Refusing(-error))
    with pytest.raises(BusError, match="cannot send: Failed to transmit"):
        CanBus("pair", bus).send(FRAMES[0])
    with pytest.raises(BusError, match="cannot receive: Error receiving"):
        CanBus("pair", bus).receive(0.0)


def test_without_such_system_calls_python_can_carries_frame_by_frame(pair, monkeypatch):
    bus, _ = pair
    monkeypatch.setattr(batches, "lib", Refusing(-errno.ENOSYS))
    sent = []
    coming = [can.Message(arbitration_id=0x123, is_extended_id=False)]
    monkeypatch.setattr(bus, "send", sent.append)
    monkeypatch.setattr(bus, "recv", lambda timeout_s: coming.pop() if coming else None)
    CanBus("pair", bus).send(*FRAMES)
    assert [content(message) for message in sent] == FRAMES
    assert CanBus("pair", bus).receive(0.0) == Frame(0x123, b"")
    assert CanBus("pair", bus).receive(0.0) is None


class Refusing:
    SOCKETCAN_BATCH_FRAMES = lib.SOCKETCAN_BATCH_FRAMES

    def __init__(self, answer):
        self.socketcan_send = self.socketcan_receive = lambda *arguments: answer


@pytest.mark.parametrize("name", ["corrupted_frames", "message_loss", "complete"])
def test_a_period_by_one_call_is_that_of_frame_by_frame(name):
    recording = load_recording(FOLDER / f"{name}.log.gz")
    at_once, one_by_one = Ecu("paper_calibrated"), Ecu("paper_calibrated")
    answered = 0
    for period in recording.periods:
        frames = [(frame.frame_id, frame.data) for frame in period.received]
        for frame in frames:
            one_by_one.receive(*frame)
        one_by_one.step()
        answer = at_once.exchange(frames)
        assert answer == one_by_one.transmit()
        answered += len(answer)
    assert answered > 5 * len(recording.periods)
