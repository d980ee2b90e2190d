"""CAN adapters that speak slcan over TCP, all on one bus, and what each was told."""

from __future__ import annotations

import socket
from socketserver import StreamRequestHandler, ThreadingTCPServer
from threading import Lock, Thread

FRAMES = b"tTrRdDbB"


class SlcanHub(ThreadingTCPServer):
    """Passes every frame that one client sends on to the others."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Adapter)
        self.commands: list[list[bytes]] = []
        """What each client said, in the order in which they came."""
        self._clients: list[_Adapter] = []
        self._lock = Lock()

    @property
    def bus(self) -> str:
        """Name of the bus for --bus."""
        return f"slcan:socket://127.0.0.1:{self.server_address[1]}"

    def __enter__(self) -> SlcanHub:
        Thread(target=self.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        self.shutdown()
        self.server_close()

    def drop(self) -> None:
        """Break the lines of all clients."""
        with self._lock:
            for client in self._clients:
                client.request.shutdown(socket.SHUT_RDWR)

    def join(self, client: _Adapter) -> list[bytes]:
        with self._lock:
            self._clients.append(client)
            self.commands.append([])
            return self.commands[-1]

    def leave(self, client: _Adapter) -> None:
        with self._lock:
            self._clients.remove(client)

    def send(self, command: bytes, sender: _Adapter | None = None) -> None:
        """Put a frame on the bus."""
        with self._lock:
            for client in self._clients:
                if client is not sender:
                    client.wfile.write(command + b"\r")


class _Adapter(StreamRequestHandler):
    server: SlcanHub

    def handle(self) -> None:
        commands = self.server.join(self)
        rest = b""
        try:
            while received := self.request.recv(4096):
                *whole, rest = (rest + received).split(b"\r")
                for command in whole:
                    commands.append(command)
                    if command[:1] in FRAMES:
                        self.server.send(command, self)
        except OSError:
            pass
        finally:
            self.server.leave(self)
