"""The Linux port on an operating system that fails where the test says, without a kernel with CAN.

test_linux_port.py has the same process on a real vcan0.
"""

from __future__ import annotations

import errno
import shutil
import signal
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from cffi import FFI

from tests.firmware.bench import HEALTHY, MEASURED, frame
from tests.firmware.native_library import FIRMWARE, load_library

NATIVE = Path(__file__).parent / "native"
SOURCES = [
    *sorted(FIRMWARE.glob("src/*.c")),
    *sorted(FIRMWARE.glob("generated/*.c")),
    FIRMWARE / "port" / "ecu_loop.c",
    FIRMWARE / "image" / "content.c",
    FIRMWARE / "image" / "sha256.c",
    *sorted(FIRMWARE.glob("port/linux/*.c")),
    NATIVE / "scripted_kernel.c",
]
FLAGS = ("-D_DEFAULT_SOURCE", "-Dmain=ecu_main", "-Wl,-Bsymbolic")
EXTRA = """
int ecu_main(int count, char **words);
int fflush(void *stream);
typedef struct { uint32_t id; uint8_t length; uint8_t pad[3]; uint8_t data[8]; } wire_t;
"""
NO_CURRENT = 0x180
DONE, CHECK_FAILED, WRONG_USE = 0, 1, 2
INTERFACE_INDEX = 7
SYNC = (0x080, b"")
Frame = tuple[int, bytes]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> tuple[FFI, Path]:
    folder = tmp_path_factory.mktemp("linux")
    headers = [str(NATIVE / "scripted_kernel.h")]
    ffi, _ = load_library(folder, SOURCES, headers, extra=EXTRA, flags=FLAGS)
    return ffi, folder / "library.so"


class Kernel:
    """Time passes in `poll` only; frames wait from the times on that the test says."""

    def __init__(self, compiled: tuple[FFI, Path], copy: Path) -> None:
        """The process has static state, so that each needs a library of its own."""
        self.ffi, library = compiled
        self.lib: Any = self.ffi.dlopen(str(shutil.copy(library, copy)))
        self.now_ms = 0
        self.waiting: list[tuple[int, Frame]] = []
        self.sent: list[tuple[int, int]] = []
        self.failures: dict[str, list[int]] = {}
        self.asked: list[tuple[str, int]] = []
        self.drops = 0
        self.read_ms = 0
        self.stops_ms = 10**9
        self.handlers: dict[int, Any] = {}
        self._callback = self.ffi.callback("int(char *, int, void *)", self._call)
        self.lib.scripted_kernel_set(self._callback)

    def run(self, *words: str) -> int:
        arguments = [self.ffi.new("char[]", word.encode()) for word in ("bms_ecu", *words)]
        code: int = self.lib.ecu_main(len(arguments), self.ffi.new("char *[]", arguments))
        self.lib.fflush(self.ffi.NULL)
        return code

    def _call(self, name: Any, number: int, data: Any) -> int:
        call = self.ffi.string(name).decode()
        self.asked.append((call, number))
        if self.failures.get(call):
            failure = self.failures[call].pop(0)
            if failure:
                return -failure
        result: int = getattr(self, f"_{call}")(number, data)
        return result

    def _index(self, _number: int, data: Any) -> int:
        name = self.ffi.string(self.ffi.cast("char *", data))
        return INTERFACE_INDEX if name == b"vcan0" else 0

    def _socket(self, _number: int, _data: Any) -> int:
        return 5

    def _buffer(self, _number: int, _data: Any) -> int:
        return 0

    _filter = _buffer

    def _bind(self, number: int, _data: Any) -> int:
        assert number == INTERFACE_INDEX
        return 0

    def _drops(self, _number: int, _data: Any) -> int:
        return self.drops

    def _time(self, _number: int, _data: Any) -> int:
        return self.now_ms

    def _wait(self, number: int, _data: Any) -> int:
        due = [time_ms for time_ms, _ in self.waiting]
        until_ms = min([self.now_ms + number, self.stops_ms, *due])
        self.now_ms = max(self.now_ms, until_ms)
        if self.now_ms >= self.stops_ms:
            self.handlers[signal.SIGTERM](signal.SIGTERM)
            self.stops_ms = 10**9
        return 0

    def _signal(self, number: int, data: Any) -> int:
        self.handlers[number] = self.ffi.cast("void(*)(int)", data)
        return 0

    def _recv(self, _number: int, data: Any) -> int:
        self.now_ms += self.read_ms
        if not self.waiting or self.waiting[0][0] > self.now_ms:
            return -errno.EAGAIN
        _, (frame_id, content) = self.waiting.pop(0)
        wire = self.ffi.cast("wire_t *", data)
        wire.id, wire.length = frame_id, len(content)
        self.ffi.memmove(wire.data, content, len(content))
        return 16

    def _send(self, _number: int, data: Any) -> int:
        self.sent.append((self.now_ms, self.ffi.cast("wire_t *", data).id))
        return 16


@pytest.fixture
def kernel(compiled: tuple[FFI, Path], tmp_path: Path) -> Kernel:
    return Kernel(compiled, tmp_path / "own.so")


def steps_ms(kernel: Kernel) -> list[int]:
    return [time_ms for time_ms, frame_id in kernel.sent if frame_id == NO_CURRENT]


def test_it_hears_steps_and_ends_after_a_silence(kernel: Kernel, capfd: Any) -> None:
    kernel.waiting = [(100 + n, f) for n, f in enumerate(frame(m, 0, HEALTHY) for m in MEASURED)]
    kernel.waiting.append((110, SYNC))
    assert kernel.run("vcan0", "--silence-s", "0.5") == DONE
    said = capfd.readouterr().out.splitlines()
    assert said == [
        "ECU on vcan0: listening",
        "ECU on vcan0: 5 frames received, 1 steps, frames lost: 0 unread, 0 unsent",
    ]
    assert steps_ms(kernel) == [110]
    assert 610 <= kernel.now_ms < 800


def test_before_the_first_frame_it_waits_for_ever_and_a_signal_ends_it(
    kernel: Kernel, capfd: Any
) -> None:
    kernel.stops_ms = 60_000
    assert kernel.run("vcan0", "--silence-s", "0.5") == DONE
    assert capfd.readouterr().out.splitlines()[-1].startswith("ECU on vcan0: 0 frames received")
    assert set(kernel.handlers) == {signal.SIGTERM, signal.SIGINT}
    assert kernel.now_ms == 60_000


def test_frames_of_a_period_that_began_earlier_pass(kernel: Kernel, capfd: Any) -> None:
    kernel.waiting = [(10 * n, SYNC) for n in range(8)] + [(200, SYNC)]
    assert kernel.run("vcan0", "--silence-s", "1") == DONE
    assert " 1 frames received" in capfd.readouterr().out
    assert steps_ms(kernel) == [200]


def test_a_bus_without_a_pause_is_listened_to_all_the_same(kernel: Kernel, capfd: Any) -> None:
    kernel.waiting = [(2 * n, SYNC) for n in range(1100)]
    assert kernel.run("vcan0", "--silence-s", "1") == DONE
    assert " 100 frames received, 100 steps" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("lost", "code"), [({}, DONE), ({"drops": 3}, CHECK_FAILED), ({"unsent": 2}, CHECK_FAILED)]
)
def test_frames_that_got_lost_fail_the_run(
    kernel: Kernel, capfd: Any, lost: dict[str, int], code: int
) -> None:
    kernel.waiting = [(100, SYNC), (200, SYNC)]
    kernel.drops = lost.get("drops", 0)
    kernel.failures["send"] = [errno.ENOBUFS] * lost.get("unsent", 0)
    assert kernel.run("vcan0") == code
    unread, unsent = lost.get("drops", 0), lost.get("unsent", 0)
    last = f"frames lost: {unread} unread, {unsent} unsent"
    assert capfd.readouterr().out.splitlines()[-1].endswith(last)


def test_what_is_over_already_is_not_waited_for(kernel: Kernel) -> None:
    kernel.waiting = [(100, frame(MEASURED[0], 0, HEALTHY))]
    kernel.read_ms = 7
    kernel.failures["wait"] = [0, 0, 0, 0, *[errno.EINTR] * 60]
    assert kernel.run("vcan0", "--silence-s", "1") == DONE
    waited_ms = [number for name, number in kernel.asked if name == "wait"]
    assert min(waited_ms) > 0 and max(waited_ms) <= 100
    assert len(steps_ms(kernel)) in range(9, 14)


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.ENOBUFS, errno.EINTR])
def test_a_bus_that_has_no_room_now_loses_the_frame_only(kernel: Kernel, number: int) -> None:
    kernel.waiting = [(100, SYNC), (200, SYNC)]
    kernel.failures["send"] = [number]
    assert kernel.run("vcan0", "--silence-s", "1") == CHECK_FAILED
    assert steps_ms(kernel) == [100, 200]


def test_a_read_that_a_signal_interrupts_is_no_failure(kernel: Kernel) -> None:
    kernel.waiting = [(100, SYNC)]
    kernel.failures["recv"] = [0, errno.EINTR, errno.EINTR]
    assert kernel.run("vcan0", "--silence-s", "1") == DONE
    assert steps_ms(kernel) == [100]


REMEDIES = {
    errno.EAFNOSUPPORT: "run the command inside tools/vcan_guest.sh",
    errno.ENODEV: "'ip link' lists the interfaces",
    errno.ENETDOWN: "bring it up with 'ip link set dev",
    errno.EPERM: "'ip link' tells its state",
}


@pytest.mark.parametrize(
    ("failures", "number"),
    [
        ({"socket": [errno.EAFNOSUPPORT]}, errno.EAFNOSUPPORT),
        ({"socket": [errno.EPERM]}, errno.EPERM),
        ({"buffer": [errno.EPERM, errno.EPERM]}, errno.EPERM),
        ({"filter": [errno.EPERM]}, errno.EPERM),
        ({"bind": [errno.ENETDOWN]}, errno.ENETDOWN),
    ],
)
def test_a_bus_that_cannot_be_opened_is_told_with_a_remedy(
    kernel: Kernel, capfd: Any, failures: dict[str, list[int]], number: int
) -> None:
    kernel.failures = failures
    assert kernel.run("vcan0") == WRONG_USE
    said = capfd.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("bms_ecu: bus 'vcan0': ") and REMEDIES[number] in line


def test_an_interface_that_is_absent_is_told(kernel: Kernel, capfd: Any) -> None:
    assert kernel.run("vcan7") == WRONG_USE
    assert REMEDIES[errno.ENODEV] in capfd.readouterr().err


def test_without_the_privilege_the_buffer_is_as_large_as_the_machine_allows(
    kernel: Kernel,
) -> None:
    kernel.waiting = [(100, SYNC)]
    kernel.failures["buffer"] = [errno.EPERM]
    assert kernel.run("vcan0", "--silence-s", "1") == DONE
    assert Counter(name for name, _ in kernel.asked)["buffer"] == 2


@pytest.mark.parametrize("call", ["recv", "send"])
def test_a_bus_that_goes_down_ends_the_process(kernel: Kernel, capfd: Any, call: str) -> None:
    kernel.waiting = [(100, SYNC), (200, SYNC)]
    kernel.failures[call] = [0] * 3 + [errno.ENETDOWN]
    assert kernel.run("vcan0") == WRONG_USE
    assert REMEDIES[errno.ENETDOWN] in capfd.readouterr().err
    assert 200 not in steps_ms(kernel)


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--help",),
        ("vcan0", "vcan1"),
        ("vcan0", "--silence-s"),
        ("vcan0", "--silence-s", ""),
        ("vcan0", "--silence-s", "1s"),
        ("vcan0", "--silence-s", "0.099"),
        ("vcan0", "--silence-s", "1000001"),
        ("vcan0", "--silence-s", "nan"),
    ],
)
def test_wrong_use_is_told_in_one_line_before_anything_is_opened(
    kernel: Kernel, capfd: Any, words: tuple[str, ...]
) -> None:
    assert kernel.run(*words) == WRONG_USE
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert kernel.asked == []


@pytest.mark.parametrize("silence_s", ["0.1", "1000000"])
def test_a_silence_up_to_its_bounds_is_taken(kernel: Kernel, silence_s: str) -> None:
    kernel.stops_ms = 1000
    assert kernel.run("--silence-s", silence_s, "vcan0") == DONE
