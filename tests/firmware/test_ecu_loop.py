"""The main loop of every port, in scripted time: lock step, own clock, and the way between them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bms.firmware import Ecu
from bms.image import calibration_content
from bms.model.pair import load_pair
from bms.native_build import CORE_HEADERS
from bms.presets import DEFAULT_PRESET
from tests.firmware.bench import DATABASE, HEALTHY, MEASURED, STATES, frame
from tests.firmware.native_library import FIRMWARE, load_library

NATIVE = Path(__file__).parent / "native"
SOURCES = [
    *sorted(FIRMWARE.glob("src/*.c")),
    *sorted(FIRMWARE.glob("generated/*.c")),
    FIRMWARE / "port" / "ecu_loop.c",
    NATIVE / "scripted_port.c",
]
LOOP_HEADERS = [
    *(header.removeprefix("firmware_c/") for header in CORE_HEADERS),
    "port/port.h",
    "port/ecu_loop.h",
]
SYNC = (0x080, b"")
COMMAND_ID = 0x180
PERIOD_MS, SILENCE_MS = 100, 5000
IN_LOCK_STEP_MS = 3
REQUEST_PERIODS = 10
OHMIC_RESISTANCE_OHM = 0.0125
Frame = tuple[int, bytes]


class Port:
    """A board in scripted time: frames come when the script says, answers are kept with time."""

    def __init__(self, ffi: Any, lib: Any, start_ms: int = 0) -> None:
        self._ffi, self._lib = ffi, lib
        self.now_ms = start_ms
        self.waiting: list[tuple[int, Frame]] = []
        self.sent: list[tuple[int, Frame]] = []
        # C keeps the addresses only.
        self._callbacks = {
            "receive": ffi.callback("bool(can_frame_t *)", self._receive),
            "send": ffi.callback("void(const can_frame_t *)", self._send),
            "time_ms": ffi.callback("uint32_t()", lambda: self.now_ms % 2**32),
            "idle": ffi.callback("void(uint32_t)", self._idle),
        }
        self._functions = ffi.new("scripted_port_t *", self._callbacks)
        self.bind()
        self.loop = ffi.new("ecu_loop_t *")
        lib.ecu_loop_init(self.loop, ffi.addressof(lib, "BMS_DEFAULT_CALIBRATION"))
        content = calibration_content(*load_pair(DEFAULT_PRESET, None))
        start = ffi.new("bms_start_t *", {"calibration_content": content})
        lib.bms_tell_start(ffi.addressof(self.loop, "bms"), start)

    def bind(self) -> None:
        """Make this the board that the C sources know; there is one at a time."""
        self._lib.scripted_port_set(self._functions)

    def run_until(self, time_ms: int) -> None:
        while self.now_ms < time_ms:
            self._end_ms = time_ms
            self._lib.ecu_loop_turn(self.loop)

    def command(self) -> dict[str, Any]:
        """The last charge command; no current before the first one."""
        data = [data for _, (frame_id, data) in self.sent if frame_id == COMMAND_ID]
        if not data:
            return {"CommandCurrent": 0.0}
        return DATABASE.get_message_by_frame_id(COMMAND_ID).decode(data[-1], decode_choices=False)

    def charge(self, first: int, last: int, *after: Frame, period_ms: float = PERIOD_MS) -> None:
        """Periods of a cell that follows the commands; frames `after` the measurements of each."""
        start_ms = self.now_ms
        for period in range(first, last):
            current_A = float(self.command()["CommandCurrent"])
            values = HEALTHY | {"Request": float(period > REQUEST_PERIODS), "Current": current_A}
            values |= {"ReferenceCurrent": -5.0}
            values |= {"Voltage": HEALTHY["Voltage"] - OHMIC_RESISTANCE_OHM * current_A}
            frames = (*(frame(name, period, values) for name in MEASURED), *after)
            self.waiting += [(self.now_ms, f) for f in frames]
            self.waiting.sort(key=lambda timed: timed[0])
            self.run_until(start_ms + round((period + 1 - first) * period_ms))

    def step_times_ms(self) -> list[int]:
        return [time_ms for time_ms, (frame_id, _) in self.sent if frame_id == COMMAND_ID]

    def _receive(self, frame: Any) -> bool:
        if not self.waiting or self.waiting[0][0] > self.now_ms:
            return False
        _, (frame.id, data) = self.waiting.pop(0)
        frame.length = len(data)
        self._ffi.memmove(frame.data, data, len(data))
        return True

    def _send(self, frame: Any) -> None:
        self.sent.append((self.now_ms, (frame.id, bytes(frame.data)[: frame.length])))

    def _idle(self, until_ms: int) -> None:
        left_ms = (until_ms - self.now_ms + 2**31) % 2**32 - 2**31  # may be over already
        events = [self.now_ms + left_ms, self._end_ms, *(time_ms for time_ms, _ in self.waiting)]
        self.now_ms = max(self.now_ms, min(events))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    headers = [*LOOP_HEADERS, str(NATIVE / "scripted_port.h")]
    ffi, lib = load_library(
        tmp_path_factory.mktemp("loop"),
        SOURCES,
        headers,
        extra="extern bms_calibration_t BMS_DEFAULT_CALIBRATION;",
    )
    return ffi, lib


@pytest.fixture(params=[0, 2**32 - 2500], ids=["from 0", "over the clock's end"])
def port(library: tuple[Any, Any], request: pytest.FixtureRequest) -> Port:
    return Port(*library, start_ms=request.param)


def measurements(period: int) -> list[Frame]:
    return [frame(name, period, HEALTHY) for name in MEASURED]


def test_in_lock_step_it_answers_as_the_ecu_in_this_process(port: Port) -> None:
    start_ms, periods = port.now_ms, 30
    for period in range(periods):
        port.waiting += [(start_ms + 3 * period, f) for f in (*measurements(period), SYNC)]
    port.run_until(start_ms + 3 * periods)
    ecu, expected = Ecu(DEFAULT_PRESET), []
    for period in range(periods):
        for frame_id, data in (*measurements(period), SYNC):
            ecu.receive(frame_id, data)
        ecu.step()
        expected += [(start_ms + 3 * period, f) for f in ecu.transmit()]
    assert port.sent == expected


def test_before_the_first_frame_it_is_silent(port: Port) -> None:
    port.run_until(port.now_ms + 10_000)
    assert port.sent == []


def test_without_sync_the_first_frame_sets_the_phase(port: Port) -> None:
    first_ms = port.now_ms + 1234
    port.waiting = [(first_ms + n, f) for n, f in enumerate(measurements(0))]
    port.run_until(first_ms + 1000)
    assert port.step_times_ms() == [first_ms + 50 + PERIOD_MS * n for n in range(10)]


def test_sync_takes_over_from_the_clock(port: Port) -> None:
    start_ms = port.now_ms
    port.waiting = [(start_ms, measurements(0)[0]), (start_ms + 170, SYNC), (start_ms + 900, SYNC)]
    port.run_until(start_ms + 2000)
    assert port.step_times_ms() == [start_ms + 50, start_ms + 150, start_ms + 170, start_ms + 900]


def test_a_charge_by_the_clock_ignores_a_foreign_sync(library: tuple[Any, Any]) -> None:
    alone, disturbed = Port(*library), Port(*library)
    for port, foreign in ((alone, ()), (disturbed, (SYNC,))):
        port.bind()
        port.charge(0, 20)
        for period in range(20, 60, 2):
            port.charge(period, period + 1, *foreign)
            port.charge(period + 1, period + 2)
    assert alone.command()["CommandCurrent"] < 0.0
    assert disturbed.sent == alone.sent


def test_when_sync_falls_silent_in_a_charge_the_clock_steps_on_and_ends_the_current(
    port: Port,
) -> None:
    port.charge(0, 60, SYNC, period_ms=IN_LOCK_STEP_MS)
    assert len(port.step_times_ms()) == 60, "a charge in lock step follows SYNC"
    assert port.command()["CommandCurrent"] < 0.0
    last_ms = port.step_times_ms()[-1]
    port.run_until(last_ms + SILENCE_MS + 950)
    silent = [last_ms + SILENCE_MS + PERIOD_MS * n for n in range(10)]
    assert port.step_times_ms()[60:] == silent
    assert port.command()["CommandCurrent"] == 0.0
    port.waiting = [(port.now_ms + 7, SYNC)]
    port.run_until(port.now_ms + 20)
    assert port.step_times_ms()[-1] == last_ms + SILENCE_MS + 957, "in lock step again"


@pytest.mark.parametrize("stall_ms", [55, 120, 1000, 1049])
def test_after_a_stall_missed_periods_are_not_caught_up_and_the_phase_stays(
    port: Port, stall_ms: int
) -> None:
    start_ms = port.now_ms
    port.waiting = [(start_ms, measurements(0)[0])]
    port.run_until(start_ms + 100)
    port.now_ms += stall_ms
    port.run_until(start_ms + 1400)
    late_ms = 100 + stall_ms
    in_phase = [ms for ms in range(150, 1400, PERIOD_MS) if ms > late_ms]
    assert port.step_times_ms() == [start_ms + ms for ms in (50, late_ms, *in_phase)]


def test_measurements_that_waited_in_a_stall_do_not_move_the_phase(port: Port) -> None:
    start_ms = port.now_ms
    port.waiting = [(start_ms, measurements(0)[0])]
    port.run_until(start_ms + 100)
    port.waiting = [(start_ms + 149 + n, measurements(1 + n)[0]) for n in range(0, 40, 2)]
    port.now_ms += 100
    port.run_until(start_ms + 1000)
    steps_ms = [ms - start_ms for ms in port.step_times_ms()]
    assert steps_ms == [50, 200, *range(250, 1000, PERIOD_MS)]


@pytest.mark.parametrize(("state", "stepped"), [(1, True), (2, False), (3, False), (4, True)])
def test_a_sync_moves_the_time_of_no_charge_whether_derated_or_not(
    port: Port, state: int, stepped: bool
) -> None:
    start_ms = port.now_ms
    port.waiting = [(start_ms, measurements(0)[0])]
    port.run_until(start_ms + 60)
    port.loop.bms.state = state
    port.waiting = [(start_ms + 70, SYNC)]
    port.run_until(start_ms + 80)
    assert (start_ms + 70 in port.step_times_ms()) is stepped


def test_without_a_calibration_it_says_so_every_tenth_of_a_second(
    library: tuple[Any, Any],
) -> None:
    ffi, lib = library
    port = Port(ffi, lib)
    lib.ecu_loop_init(port.loop, ffi.NULL)
    port.waiting = [(0, measurements(0)[0])]
    port.run_until(1000)
    assert port.step_times_ms() == [50 + PERIOD_MS * n for n in range(10)]
    assert port.command()["CommandCurrent"] == 0.0
    assert STATES[int(port.command()["CommandState"])] == "Fault"


@pytest.mark.parametrize("period_ms", [99.8, 100.2])
def test_steps_stay_between_the_measurements_of_a_clock_that_runs_apart(
    port: Port, period_ms: float
) -> None:
    """A foreign frame set the phase; over the minute both clocks part by more than a period."""
    start_ms = port.now_ms
    port.waiting = [(start_ms, (0x7F0, b"foreign"))]
    port.run_until(start_ms + 48)
    measured_from_ms = port.now_ms
    port.charge(0, 600, period_ms=period_ms)
    after_ms = [
        (step_ms - measured_from_ms) % period_ms
        for step_ms in port.step_times_ms()
        if step_ms > measured_from_ms + 2 * PERIOD_MS
    ]
    assert len(after_ms) == pytest.approx(600, abs=5)
    assert all(40.0 <= late_ms <= 60.0 for late_ms in after_ms)
    assert STATES[int(port.command()["CommandState"])] == "Charging"


@pytest.mark.parametrize(
    ("period_s", "valid"),
    [(0.001, True), (10.0, True), (0.00099, False), (10.001, False), (1e30, False), (-0.1, False)],
)
def test_a_calibration_has_a_period_that_the_clock_can_keep(
    library: tuple[Any, Any], period_s: float, valid: bool
) -> None:
    ffi, lib = library
    block = ffi.new("bms_calibration_t *", lib.BMS_DEFAULT_CALIBRATION)
    block.sampling_period_s = period_s
    assert lib.calibration_is_valid(block) == valid


def test_frames_without_end_do_not_stop_the_clock(port: Port) -> None:
    start_ms = port.now_ms
    endless = measurements(0)[0]
    port.waiting = [(start_ms + n // 20, endless) for n in range(20 * 300)]
    port.run_until(start_ms + 300)
    assert port.step_times_ms() == [start_ms + 50, start_ms + 150, start_ms + 250]
