"""The other end of an slcan line in a thread, for tests of this end."""

from __future__ import annotations

import socket
from collections.abc import Callable
from threading import Thread

from hil_sim.bus.closing import Closing

_PATIENCE_S = 10.0

Answer = Callable[[bytes], bytes]


class Line(Closing):
    """Listens on a free port; `answer` gets each line of text and gives the bytes to send back."""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.bus = f"slcan:socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.chunks: list[bytes] = []
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        self._listener.settimeout(_PATIENCE_S)
        connection, _ = self._listener.accept()
        connection.settimeout(None)
        begun = b""
        with connection:
            while chunk := connection.recv(1 << 16):
                self.chunks.append(chunk)
                *lines, begun = (begun + chunk).split(b"\r")
                said = b"".join(self._answer(line) for line in lines)
                if said == b"hang up":
                    return
                connection.sendall(said)

    def close(self) -> None:
        """Wait until the other end has hung up."""
        self._thread.join(_PATIENCE_S)
        self._listener.close()


def text(frame_id: int, data: bytes) -> bytes:
    """A frame as slcan writes it."""
    return b"t%03X%d%s\r" % (frame_id, len(data), data.hex().upper().encode())


def frame(line: bytes) -> tuple[int, bytes] | None:
    """Identifier and data of a line; None for a command."""
    if line[:1] != b"t":
        return None
    return int(line[1:4], 16), bytes.fromhex(line[5:].decode())
