"""Why an ECU starts, how often in a row, and when its boot stage gives up."""

from __future__ import annotations

import struct
import time
from pathlib import Path
from typing import Any

import pytest

from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.catalog import ResetCause
from hil_sim.targets import Emulation
from tests.firmware.damaged_images import (
    APPLICATION,
    BOARD,
    VECTORS,
    parts,
    patched,
    with_parts,
)
from tests.firmware.monitor import monitor, monitor_options
from tests.firmware.native_library import FIRMWARE, load_library
from tests.firmware.ports import image, needs_emulator
from tests.firmware.test_boot import (
    ANSWER_TIMEOUT_S,
    CODECS,
    heard,
    put,
    says_no_current_and_why,
)

UNDEFINED, FOR_EVER = 0xDE00DE00, 0xE7FEE7FE
POWER_ON, FAULT, WATCHDOG, OTHER = (cause.value for cause in list(ResetCause)[:4])


class Record:
    """A record in memory that starts share, as firmware_c/boot/restart.c keeps it."""

    def __init__(self, folder: Path, change: tuple[str, str] | None = None) -> None:
        sources, headers = [FIRMWARE / "boot" / "restart.c"], ["boot/restart.h"]
        replaced = None if change is None else ("restart.c", *change)
        ffi, self._lib = load_library(folder, sources, headers, replaced)
        self.memory: Any = ffi.new("restart_record_t *", {"count": 99})

    def start(self, noted: int | None = None) -> tuple[int, int, bool]:
        """(cause, count, whether it is time to give up) of a start that somebody noted."""
        if noted is not None:
            self.memory.noted = noted
        self._lib.restart_begin(self.memory)
        hopeless = self._lib.restart_is_hopeless(self.memory)
        return self.memory.cause, self.memory.count, hopeless

    def clear(self) -> None:
        memory = self.memory
        memory.noted = memory.cause = memory.count = memory.check = 0

    def forgive(self) -> None:
        self._lib.restart_forgive(self.memory)


def goes_right(record: Record) -> None:
    """Every rule of the record, once."""
    assert record.start() == (POWER_ON, 0, False), "noise is no record"
    record.clear()
    assert record.start(FAULT) == (POWER_ON, 0, False), "nor is cleared memory"
    assert [record.start(FAULT) for _ in range(3)] == [
        (FAULT, 1, False),
        (FAULT, 2, False),
        (FAULT, 3, True),
    ]
    record.forgive()
    assert [record.start(noted) for noted in (FAULT, None, WATCHDOG, 77)] == [
        (FAULT, 1, False),
        (OTHER, 2, False),
        (WATCHDOG, 3, True),
        (OTHER, 4, True),
    ], "causes that take turns, one of which nobody can have noted"
    record.forgive()
    assert record.start(WATCHDOG) == (WATCHDOG, 1, False), "it ran for long enough"
    for _ in range(400):
        last = record.start(WATCHDOG)
    assert last == (WATCHDOG, 253, True), "more is not available"
    record.memory.count = 0
    assert record.start(FAULT) == (POWER_ON, 0, False), "a damaged record is none"


def test_starts_are_counted_whatever_their_causes(tmp_path: Path) -> None:
    goes_right(Record(tmp_path))


@pytest.mark.parametrize(
    "change",
    [
        ("if (record->check != check_of(record))", "if (false)"),
        ("CHECK_START +", "UINT32_MAX +"),
        ("record->count + 1u", "((record->noted == record->cause) ? record->count : 0u) + 1u"),
        ("record->count >= RESTART_MOST", "record->count > RESTART_MOST"),
        ("(record->count < MOST_COUNTED)", "(true)"),
        ("record->noted = RESTART_OTHER;", ""),
        ("    record->count = 0u;\n", ""),
        (": (uint32_t)RESTART_OTHER", ": record->noted"),
    ],
    ids=lambda change: change[0].strip(),
)
def test_a_broken_rule_is_noticed(change: tuple[str, str], tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        goes_right(Record(tmp_path, change))


@needs_emulator
@pytest.mark.parametrize(
    ("code", "status"), [(UNDEFINED, "REPEATED_FAULTS"), (FOR_EVER, "REPEATED_WATCHDOG")]
)
def test_an_application_that_restarts_for_ever_is_stopped_and_says_why(
    code: int, status: str, tmp_path: Path
) -> None:
    application, calibration = parts(image())
    (entry,) = struct.unpack_from("<I", application, VECTORS + 4)
    broken = patched(application, (entry & ~3) - APPLICATION.address, code, code)
    path = put(with_parts(image(), broken, calibration), tmp_path)
    frames = [frame for _, frame in heard(path, periods=2, timeout_s=30.0)]
    says_no_current_and_why(frames, "APPLICATION", status)


@needs_emulator
def test_a_board_that_was_reset_says_so_on_the_bus(tmp_path: Path) -> None:
    path, socket_path = put(image(), tmp_path), tmp_path / "m"
    with (
        Emulation(path, BOARD, options=monitor_options(socket_path)) as board,
        monitor(socket_path) as observer,
    ):
        board.await_line()
        observer.execute("system_reset")
        observer.execute("query-status")  # answered after the reset
        board.await_line()
        with open_bus(board.bus) as bus:
            bus.send(Frame(CODECS["SYNC"].frame_id, b""))
            frame = bus.receive(ANSWER_TIMEOUT_S)
            while frame is not None and frame.frame_id != CODECS["Start"].frame_id:
                frame = bus.receive(ANSWER_TIMEOUT_S)
    assert frame is not None
    values = CODECS["Start"].decode(frame.data)
    assert values is not None
    assert (values["ResetCause"], values["ResetCount"]) == (OTHER, 1)


@needs_emulator
def test_a_board_that_turns_is_left_alone_by_its_watchdog(tmp_path: Path) -> None:
    """A restart would close the channel, so that the second SYNC had no answer."""
    sync = Frame(CODECS["SYNC"].frame_id, b"")
    with Emulation(put(image(), tmp_path), BOARD) as board, open_bus(board.bus) as bus:
        for wait_s in (0.0, 3.0):
            time.sleep(wait_s)
            bus.send(sync)
            frame = bus.receive(ANSWER_TIMEOUT_S)
            while frame is not None and frame.frame_id != CODECS["ChargeCommand"].frame_id:
                frame = bus.receive(ANSWER_TIMEOUT_S)
            assert frame is not None, f"silent after {wait_s} s"
