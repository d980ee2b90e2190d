"""A microcontroller board in QEMU: starts an image, gives its serial line as a CAN bus, stops."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from bms.errors import BusError, InputError
from bms.image import TARGETS
from hil_sim.bus.closing import Closing

PROGRAM = "qemu-system-arm"
HOST = "127.0.0.1"
_STOP_TIMEOUT_S = 5.0


def require_emulator() -> str:
    """Path of QEMU; InputError where there is none."""
    program = shutil.which(PROGRAM)
    if program is None:
        raise InputError(f"{PROGRAM}: not installed; run 'apt-get install qemu-system-arm'")
    return program


class Emulation(Closing):
    """A running board; a context manager that ends it.

    `bus` is the name under which open_bus reaches its serial line, which one party at a time can
    use. The line is listened on before the board starts, so that nobody comes too early.
    """

    def __init__(
        self,
        image: Path,
        target: str,
        port: int = 0,
        log: Path | None = None,
        options: tuple[str, ...] = (),
    ) -> None:
        """Start a board with a binary or ELF image; `port` 0 is any that is free.

        What QEMU says goes to `log`, `options` to QEMU. Raises InputError for an unknown target,
        a missing QEMU, a port that is in use or a log that cannot be written.
        """
        if target not in TARGETS:
            raise InputError(f"target '{target}': unknown; choose one of {', '.join(TARGETS)}")
        program = require_emulator()
        with _listening(port) as line:
            self.port: int = line.getsockname()[1]
            chardev = f"socket,id=line,fd={line.fileno()},server=on,wait=off"
            arguments = [program, "-machine", target, "-kernel", str(image)]
            arguments += ["-display", "none", "-monitor", "none", "-nodefaults"]
            arguments += ["-chardev", chardev, "-serial", "chardev:line", *options]
            self._log = subprocess.DEVNULL if log is None else _opened(log)
            with _on_one_core(self.port // 2):  # the system gives out odd ports only
                self._process = subprocess.Popen(
                    arguments,
                    stdin=subprocess.DEVNULL,
                    stdout=self._log,
                    stderr=subprocess.STDOUT,
                    pass_fds=(line.fileno(),),
                )

    @property
    def bus(self) -> str:
        """Name of the serial line as a CAN bus."""
        return f"slcan:socket://{HOST}:{self.port}"

    def await_line(self, timeout_s: float = 30.0) -> None:
        """Return when the board says anything on its line, asked for its version.

        A board whose image does not start is found here, before anybody waits for its answers.
        Raises BusError when nothing comes.
        """
        try:
            with socket.create_connection((HOST, self.port), timeout_s) as line:
                line.sendall(b"V\r")
                if line.recv(1):
                    return
            reason = "the emulator has ended"
        except OSError as error:
            reason = str(error)
        raise BusError(f"bus '{self.bus}': the board does not start ({reason}); flash it anew")

    @property
    def is_running(self) -> bool:
        """Whether the board has not ended by itself."""
        return self._process.poll() is None

    def wait(self, timeout_s: float) -> int | None:
        """Wait until the board ends by itself; its exit code, None when it goes on running."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def close(self) -> None:
        """End the emulator; by force when it does not end in time."""
        self._process.terminate()
        try:
            self._process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if not isinstance(self._log, int):
            self._log.close()


@contextmanager
def _on_one_core(number: int) -> Iterator[None]:
    """Processes started within stay on one core, by the number modulo the cores.

    QEMU's two threads pass every byte of the line to each other: on one core a control period takes
    half the time that it takes on two.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {sorted(cores)[number % len(cores)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _opened(log: Path) -> IO[bytes]:
    try:
        return log.open("wb")
    except OSError as error:
        raise InputError(
            f"{log}: cannot be written ({error.strerror}); choose a folder that can"
        ) from None


def _listening(port: int) -> socket.socket:
    line = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    # Connections inherit this: an answer of a few short lines must not wait for the next.
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    try:
        line.bind((HOST, port))
        line.listen(1)
    except OSError as error:
        line.close()
        raise InputError(
            f"port {port}: cannot be listened on ({error.strerror}); choose another or 0"
        ) from None
    return line
