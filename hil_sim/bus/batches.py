"""python-can's virtual and SocketCAN buses, which also take and give many frames by one call.

They are buses of python-can like others, and meet those on the same channel. What `hear` and
`send_frames` leave out is what python-can does for each frame: a lock and copies on the virtual
bus, two system calls on SocketCAN.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from collections import deque
from collections.abc import Sequence
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple, Protocol, cast, runtime_checkable

import can
from can.interfaces.socketcan import SocketcanBus
from can.interfaces.virtual import VirtualBus, channels_lock

from hil_sim.bus.foreign import ForeignFrame, foreign_kind
from hil_sim.bus.frame import Frame
from hil_sim.native._native import ffi, lib

RECEIVE_BUFFER_BYTES = 1 << 20
_MS_PER_S = 1000.0


@runtime_checkable
class BatchBus(Protocol):
    """What CanBus asks of a bus that can do more than one frame at a time."""

    def send_frames(self, frames: Sequence[Frame]) -> None:
        """Put frames on the bus in order; raises what python-can's send raises."""

    def hear(self, timeout_s: float) -> list[Frame | ForeignFrame]:
        """All that has come, after a wait of up to timeout_s for the first; empty without any."""
        ...


class VirtualBatchBus(VirtualBus):
    """The virtual bus with a queue in C.

    Frames of a batch go to others of this class as they are, and to every other party on the
    channel as messages of python-can.
    """

    def __init__(self, channel: str, **options: Any) -> None:
        super().__init__(channel=channel, **options)
        self._read = deque[can.Message]()
        messages: Any = _BatchQueue()
        with channels_lock:
            self.channel[self.channel.index(self.queue)] = messages
            self.queue = messages

    def send_frames(self, frames: Sequence[Frame]) -> None:
        """Put frames on the bus in order."""
        self._check_if_open()
        batch = _Batch(time.time(), frames)
        for queue in self.channel:
            if queue is self.queue:
                continue
            if isinstance(queue, _BatchQueue):
                queue.put(batch)
            else:
                for message in batch.messages(self.channel_id):
                    queue.put(message)

    def hear(self, timeout_s: float) -> list[Frame | ForeignFrame]:
        """All that has come; see BatchBus."""
        if self._filters or self._read:
            message = self.recv(timeout_s)
            return [] if message is None else [heard_of(message)]
        self._check_if_open()
        queue: _BatchQueue = cast(Any, self.queue)
        if timeout_s == 0.0 and queue.empty():
            return []
        try:
            coming = [queue.get(timeout=timeout_s)]
            coming += [queue.get() for _ in range(queue.qsize())]
        except Empty:
            return []
        heard: list[Frame | ForeignFrame] = []
        for one in coming:
            if isinstance(one, _Batch):
                heard += one.frames
            else:
                heard.append(heard_of(one))
        return heard

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """For python-can's recv: one message at a time, of a batch too."""
        if not self._read:
            one: Any = super()._recv_internal(timeout)[0]
            self._read += one.messages(self.channel_id) if isinstance(one, _Batch) else [one]
        return self._read.popleft(), False


class _Batch(NamedTuple):
    """Frames that were sent at one time."""

    time_s: float
    frames: Sequence[Frame]

    def messages(self, channel: Any) -> list[can.Message]:
        return [
            can.Message(self.time_s, frame_id, is_extended_id=False, channel=channel, data=data)
            for frame_id, data in self.frames
        ]


class _BatchQueue(SimpleQueue["can.Message | _Batch"]):
    """Of a bus that takes batches."""


def heard_of(message: can.Message) -> Frame | ForeignFrame:
    """A message of python-can as the nodes see it."""
    return foreign_kind(message) or Frame(message.arbitration_id, bytes(message.data))


_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
_FLAGS = _EXTENDED | _REMOTE | _ERROR


class SocketcanBatchBus(SocketcanBus):
    """SocketCAN with one system call for many frames, where Linux has it."""

    def __init__(self, channel: str, **options: Any) -> None:
        super().__init__(channel=channel, **options)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._batch = ffi.new("socketcan_frame_t[]", lib.SOCKETCAN_BATCH_FRAMES)
        self._poll = select.poll()
        self._poll.register(self.socket, select.POLLIN)
        self._had_to_wait = False

    def send_frames(self, frames: Sequence[Frame]) -> None:
        """Put frames on the bus in order; what does not go at once goes as python-can sends it."""
        batch, most = self._batch, lib.SOCKETCAN_BATCH_FRAMES
        done = 0
        while done < len(frames):
            part = frames[done : done + most]
            for target, (frame_id, data) in zip(batch, part):
                target.id, target.length = frame_id, len(data)
                ffi.memmove(target.data, data, len(data))
            sent = lib.socketcan_send(self.socket.fileno(), batch, len(part))
            if sent <= 0:
                self._send_one(frames[done], sent)
                sent = 1
            done += sent

    def _send_one(self, frame: Frame, error: int) -> None:
        if error not in (0, -errno.EINTR, -errno.ENOSYS):
            raise can.CanOperationError(f"Failed to transmit: {os.strerror(-error)}", -error)
        self.send(can.Message(arbitration_id=frame.frame_id, data=frame.data, is_extended_id=False))

    def hear(self, timeout_s: float) -> list[Frame | ForeignFrame]:
        """All that has come; see BatchBus."""
        count = 0 if self._had_to_wait else self._receive()
        self._had_to_wait = count == 0
        if count == 0:
            if not self._poll.poll(timeout_s * _MS_PER_S):
                return []
            count = self._receive()
        if count < 0:
            message = self.recv(0.0)
            return [] if message is None else [heard_of(message)]
        return [_heard(self._batch[n]) for n in range(count)]

    def _receive(self) -> int:
        """Number of frames in the batch; negative on a system that cannot fill one."""
        count: int = lib.socketcan_receive(self.socket.fileno(), self._batch)
        if count == -errno.EINTR:
            return 0
        if count < 0 and count != -errno.ENOSYS:
            raise can.CanOperationError(f"Error receiving: {os.strerror(-count)}", -count)
        return count


def _heard(raw: Any) -> Frame | ForeignFrame:
    frame_id = raw.id
    if raw.size != lib.SOCKETCAN_CLASSICAL_BYTES:
        return ForeignFrame.FD
    if not frame_id & _FLAGS:
        return Frame(frame_id, bytes(ffi.buffer(raw.data, raw.length)))
    if frame_id & _ERROR:
        return ForeignFrame.ERROR
    return ForeignFrame.REMOTE if frame_id & _REMOTE else ForeignFrame.EXTENDED
