"""slcan over a socket: CAN frames as lines of text, as QEMU's serial line and network adapters.

python-can's own slcan serves serial adapters. On a socket it sends a packet for every frame, which
waits for the last one's acknowledgement, tens of milliseconds a control period, and reads byte by
byte. Here frames wait until the sender listens, and go out together.
"""

from __future__ import annotations

import re
import select
import socket
import time
from collections import deque
from typing import Any

import can

from hil_sim.bus.limits import HIGHEST_EXTENDED_ID, HIGHEST_STANDARD_ID

SCHEME = "socket://"
_SETTINGS = b"C\rS6\r"
"""Closed, so that it may be set; 500 kbit/s."""
_CONNECT_TIMEOUT_S = 5.0
_CHUNK_BYTES = 1 << 16
_LONGEST_LINE = 64
_MOST_WAITING_BYTES = 1 << 14
_REFUSED = b"\a"
_HIGHEST_ID = {False: HIGHEST_STANDARD_ID, True: HIGHEST_EXTENDED_ID}
"""By whether the identifier is extended."""
_FRAME = re.compile(
    rb"([trTR])((?<=[tr])[0-9A-Fa-f]{3}|(?<=[TR])[0-9A-Fa-f]{8})([0-8])((?:[0-9A-Fa-f]{2})*)"
)
"""Kind, identifier, length, data, and perhaps a time stamp."""


class SlcanSocketBus(can.BusABC):
    """One end of a line to `socket://HOST:PORT`; sends data frames with 11-bit identifiers."""

    def __init__(self, channel: str, listen_only: bool = False, **kwargs: Any) -> None:
        """Connect and open the channel; CanInitializationError when nobody listens there."""
        host, _, port = channel.removeprefix(SCHEME).rpartition(":")
        if not (host and port.isdigit()):
            raise can.CanInitializationError(f"'{channel}' is not {SCHEME}HOST:PORT")
        try:
            self._socket = socket.create_connection((host, int(port)), _CONNECT_TIMEOUT_S)
        except (OSError, OverflowError) as error:
            raise can.CanInitializationError(f"{host}:{port}: {error}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self._waiting = bytearray()
        self._begun = b""
        self._lines: deque[bytes] = deque()
        self._is_in_use = False
        super().__init__(channel, **kwargs)
        self._write(_SETTINGS + (b"L\r" if listen_only else b"O\r"))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame on the line at the next recv or shutdown, or when many wait."""
        data = msg.data.hex().upper()
        self._waiting += f"t{msg.arbitration_id:03X}{msg.dlc:d}{data}\r".encode()
        if len(self._waiting) > _MOST_WAITING_BYTES:
            self._flush()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._flush()
        if not self._lines and self._poll.poll(None if timeout is None else 1000.0 * timeout):
            self._read()
        while self._lines:
            message = _message(self._lines.popleft())
            if message is not None:
                self._is_in_use = True
                return message, False
        return None, False

    def shutdown(self) -> None:
        """Send what waits, close the channel and the connection."""
        if not self._is_shutdown:
            super().shutdown()
            try:
                self._flush()
                self._write(b"C\r")
            except can.CanOperationError:
                pass  # the other end is gone already
            self._socket.close()

    def _flush(self) -> None:
        if self._waiting:
            self._write(bytes(self._waiting))
            self._waiting.clear()

    def _write(self, text: bytes) -> None:
        try:
            self._socket.sendall(text)
        except OSError as error:
            raise can.CanOperationError(f"the line is broken: {error}") from None

    def _read(self) -> None:
        try:
            chunk = self._socket.recv(_CHUNK_BYTES)
        except OSError as error:
            raise can.CanOperationError(f"the line is broken: {error}") from None
        if not chunk:
            raise can.CanOperationError("the other end has closed the line")
        # Adapters refuse settings that they do not know, but a frame only when it came damaged.
        if _REFUSED in chunk and self._is_in_use:
            raise can.CanOperationError("the other end refused a frame; bytes were lost on the way")
        *lines, self._begun = (self._begun + chunk).replace(_REFUSED, b"\r").split(b"\r")
        self._begun = self._begun[-_LONGEST_LINE:]
        self._lines.extend(filter(None, lines))


def _message(line: bytes) -> can.Message | None:
    """The frame of a line; None for a damaged line and for status."""
    match = _FRAME.fullmatch(line)
    if match is None:
        return None
    kind, digits, length, data = match.groups()
    is_remote, is_extended = kind in b"rR", kind in b"TR"
    frame_id, count = int(digits, 16), int(length)
    if frame_id > _HIGHEST_ID[is_extended] or (len(data) < 2 * count and not is_remote):
        return None
    return can.Message(
        arbitration_id=frame_id,
        dlc=count,
        data=None if is_remote else bytes.fromhex(data[: 2 * count].decode()),
        is_extended_id=is_extended,
        is_remote_frame=is_remote,
        timestamp=time.time(),
    )
