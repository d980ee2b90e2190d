"""The ECU as a unit: the frames of the bus, its calibration, its clock, its bus operations."""

from __future__ import annotations

import struct
import zlib
from ctypes import c_double, c_int, c_uint32
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bms.errors import InputError
from bms.firmware import Ecu
from bms.firmware._firmware import ffi
from bms.firmware.calibration import calibration_hashes
from bms.firmware.image_header import CRC_COVERS_FROM, HEADER_LENGTH, Header
from bms.image import calibration_part
from bms.image.seal import sealed_part
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from hil_sim.bus.catalog import FrameId
from hil_sim.fmu.driven_ecu import DrivenEcu
from hil_sim.fmu.unit import Unit
from hil_sim.logs.recorder import PeriodRecorder, Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from tests.hil_sim.units import PRESET, exported_ecu, exported_plant, opened, written

RX_DATA, TX_DATA, RX_CLOCK, TX_CLOCK, NOTIFICATIONS = range(1, 6)
PERIOD_S = 0.1
CALIBRATION = "resources/calibration.bin"
CONFIGURATION = bytes.fromhex("40000000 0d000000 01 20a10700 40000000 0a000000 04 01")
"""500 kbit/s; what loses arbitration is to be sent again by the bus."""
STATUS = {name: bytes.fromhex(f"41000000 09000000 0{n}") for n, name in
          enumerate(("active", "passive", "off"), 1)}  # fmt: skip


@pytest.fixture(scope="module")
def ecu_path(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("ecu"), exported_ecu())


def calibrated(preset: str) -> bytes:
    return calibration_part(load_preset(preset), load_shipped_model(preset))


def log_of(path: Path, ecu: Path | None, plant: str, **changes: Any) -> bytes:
    """All frames of a charge, with the firmware in the process or in a unit."""
    settings = Settings(plant=plant, **{"preset": load_preset(PRESET), **changes})
    period_s = settings.preset.timing.sampling_period_s
    factory = None if ecu is None else (lambda plant, database: DrivenEcu(ecu, period_s))
    with Recorder(path) as recorder:
        run_both(settings, recorder, ecu_factory=factory)
    return path.read_bytes()


def test_a_charge_of_both_units_is_that_of_the_bus_frame_by_frame(tmp_path, ecu_path):
    """With the time of every frame; the page of the docs does it to the end of the charge."""
    plant = written(tmp_path, exported_plant(3), "plant.fmu")
    units = log_of(tmp_path / "units.log", ecu_path, f"fmu:{plant}", max_time_s=100.0)
    bus = log_of(tmp_path / "bus.log", None, "two-mass", max_time_s=100.0)
    assert len(bus.splitlines()) > 10_000
    assert units == bus


def test_with_another_calibration_as_its_resource_it_is_the_ecu_of_that(tmp_path):
    """A family: other tables, other constants, a cell with branches and tables in the plant."""
    preset = load_preset("a123_26650_10C")
    ecu = written(tmp_path, opened(exported_ecu()) | {CALIBRATION: calibrated(preset.name)})
    plant = written(tmp_path, exported_plant(2, preset.name), "plant.fmu")
    changes = {"preset": preset, "max_time_s": 30.0}
    units = log_of(tmp_path / "units.log", ecu, f"fmu:{plant}", **changes)
    assert units == log_of(tmp_path / "bus.log", None, "two-mass", **changes)


def flipped(part: bytes) -> bytes:
    return part[:-1] + bytes([part[-1] ^ 1])


def edited(part: bytes, place: int, content: bytes, **header: int) -> bytes:
    """The part with other bytes or another header, and with the hashes that belong to that."""
    part = part[:place] + content + part[place + len(content) :]
    changed = replace(Header.parse(part), **header).pack() + part[HEADER_LENGTH:]
    return sealed_part(changed, *calibration_hashes(part[HEADER_LENGTH:]))


def resummed(part: bytes) -> bytes:
    """Edited by somebody who knows of the CRC-32 but not of the hash."""
    damaged = flipped(part)
    crc32 = zlib.crc32(damaged[CRC_COVERS_FROM:])
    return replace(Header.parse(damaged), crc32=crc32).pack() + damaged[HEADER_LENGTH:]


PERIOD_PLACE = HEADER_LENGTH + ffi.offsetof("bms_calibration_t", "sampling_period_s")
NOT_A_NUMBER = struct.pack("<f", float("nan"))


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda part: None, "cannot be read"),
        (lambda part: b"", "is no calibration"),
        (lambda part: b"\0" + part, "is no calibration"),
        (lambda part: part[:-1], "is truncated"),
        (flipped, r"is damaged \(CRC-32\)"),
        (resummed, r"was edited after it had been made \(SHA-256\)"),
        (lambda part: edited(part, 0, b"", firmware_version=1), "is for another firmware version"),
        (lambda part: edited(part, 0, b"", calibration_layout=1), "has another layout than this"),
        (lambda part: edited(part, 0, b"", header_layout=1), "has a header of another layout"),
        (
            lambda part: edited(part, PERIOD_PLACE, NOT_A_NUMBER),
            "has a number that the firmware does not accept",
        ),
        (lambda part: part + b"\0", "has bytes behind its end"),
        (lambda part: part + bytes(100_000), "is longer than any calibration"),
    ],
)
def test_a_calibration_that_is_none_is_refused_with_reason_and_remedy(tmp_path, edit, said):
    files = opened(exported_ecu())
    changed = edit(files.pop(CALIBRATION))
    if changed is not None:
        files[CALIBRATION] = changed
    with pytest.raises(InputError, match=f"does not start: resources/calibration.bin {said}") as no:
        DrivenEcu(written(tmp_path, files), PERIOD_S)
    assert "'bms export --preset PRESET --model MODEL --out DIR'" in str(no.value)
    assert "\n" not in str(no.value)


class Importer:
    """An importer with one ECU, which is told of every call what it is."""

    def __init__(self, path: Path) -> None:
        self.unit = Unit(path, "ecu")
        self.unit.instantiate(event_mode=True)
        self.unit.enter_initialization()
        self.unit.initialize()
        self.slave = self.unit.slave
        self.now_s = 0.0
        self.first = self.sent()
        self.slave.enterStepMode()

    def interval_s(self) -> float | None:
        """Time to the next tick of Tx_Clock; None where it is not known or has not changed."""
        interval_s, qualifier = (c_double * 1)(), (c_int * 1)()
        self.slave.getIntervalDecimal((c_uint32 * 1)(TX_CLOCK), interval_s, qualifier)
        return interval_s[0] if qualifier[0] == 2 else None

    def sent(self) -> bytes:
        self.slave.setClock([TX_CLOCK], [True])
        data = self.slave.getBinary([TX_DATA])[0]
        self.slave.updateDiscreteStates()
        return data

    def told(self, operations: bytes) -> bytes:
        """What the ECU answers at the same time."""
        self.slave.enterEventMode()
        self.slave.setClock([RX_CLOCK], [True])
        self.slave.setBinary([RX_DATA], [operations])
        self.slave.updateDiscreteStates()
        self.next_s = self.interval_s()
        answer = self.sent() if self.next_s == 0.0 else b""
        self.slave.enterStepMode()
        return answer

    def tick(self) -> bytes:
        """Tx_Clock ticks now."""
        self.slave.enterEventMode()
        data = self.sent()
        self.next_s = self.interval_s()
        self.slave.enterStepMode()
        return data

    def wait(self, time_s: float) -> bool:
        """Whether the unit asks for an event afterwards."""
        needs_event, *_ = self.slave.doStep(self.now_s, time_s)
        self.now_s += time_s
        return bool(needs_event)


@pytest.fixture
def importer(ecu_path) -> Importer:
    return Importer(ecu_path)


def transmit(frame_id: int, data: bytes, extended: int = 0, remote: int = 0) -> bytes:
    arguments = struct.pack("<IBBH", frame_id, extended, remote, len(data)) + data
    return operation(0x10, arguments)


def operation(code: int, arguments: bytes = b"") -> bytes:
    return struct.pack("<II", code, 8 + len(arguments)) + arguments


def frames_of(data: bytes) -> list[tuple[int, bytes]]:
    found = []
    while data:
        code, length, frame_id, extended, remote, count = struct.unpack_from("<IIIBBH", data)
        assert (code, length, extended, remote) == (0x10, 16 + count, 0, 0)
        found.append((frame_id, data[16:length]))
        data = data[length:]
    return found


@pytest.fixture(scope="module")
def periods() -> list[list[tuple[int, bytes]]]:
    """What the plant sends in the first control periods of a charge, SYNC aside."""
    recorder = PeriodRecorder()
    run_both(Settings(preset=load_preset(PRESET), max_time_s=1.0), recorder)
    return [[(f.frame_id, f.data) for f in period] for period in recorder.periods]


def measurements(period: list[tuple[int, bytes]]) -> bytes:
    return b"".join(transmit(*frame) for frame in period)


SYNC = transmit(FrameId.SYNC, b"")


def test_first_of_all_it_configures_the_bus(importer):
    assert importer.first == CONFIGURATION
    assert importer.wait(PERIOD_S) is False


def test_on_sync_it_answers_at_the_same_time(importer, periods):
    ecu = Ecu(PRESET)
    for period in periods[:5]:
        assert importer.told(measurements(period)) == b"", "it waits for SYNC"
        answer = importer.told(SYNC)
        assert importer.next_s == 0.0
        assert frames_of(answer) == ecu.exchange([*period, (FrameId.SYNC, b"")])
        importer.wait(PERIOD_S)


def test_without_sync_it_steps_midway_between_measurements(importer, periods):
    """And goes on when they stop, as a real ECU does, which then commands 0 A."""
    ecu = Ecu(PRESET)
    for period in periods[:30]:
        importer.told(measurements(period))
        assert importer.next_s == pytest.approx(PERIOD_S / 2)
        assert importer.wait(PERIOD_S / 2) is True
        assert frames_of(importer.tick()) == ecu.exchange(period)
        assert importer.next_s == pytest.approx(PERIOD_S)
        assert importer.wait(PERIOD_S / 2) is False
    importer.wait(PERIOD_S / 2)
    for _ in range(5):
        answer = frames_of(importer.tick())
        assert answer == ecu.exchange([])
        assert answer[-1][0] == FrameId.CHARGE_COMMAND
        assert importer.wait(PERIOD_S) is True


def test_before_the_first_frame_nothing_is_due(importer):
    importer.slave.enterEventMode()
    assert importer.interval_s() is None
    importer.slave.enterStepMode()
    assert importer.wait(10.0) is False
    assert importer.tick() == b""


def test_what_it_said_of_its_interval_has_not_changed_until_the_next_event(importer, periods):
    importer.told(measurements(periods[0]))
    importer.slave.enterEventMode()
    assert importer.interval_s() is None
    importer.slave.updateDiscreteStates()
    assert importer.interval_s() == pytest.approx(PERIOD_S / 2)


@pytest.mark.parametrize(
    "foreign",
    [
        transmit(FrameId.SYNC, b"", extended=1),
        transmit(FrameId.SYNC, b"", remote=1),
        operation(0x11, bytes(9)),  # CAN FD
        operation(0x12, bytes(15)),  # CAN XL
        operation(0x40, bytes(5)),  # somebody else's configuration
        operation(0x41, b"\3"),  # and status
        operation(0x42),  # wake up
        operation(0x01, b"\0\0"),  # a format error is not answered
        operation(0x20, bytes(4)),  # a confirmation
    ],
)
def test_operations_that_are_not_for_it_change_nothing(importer, foreign):
    assert importer.told(foreign) == b""


@pytest.mark.parametrize(
    "wrong",
    [
        b"\x10",
        operation(0x10, bytes(7)),
        transmit(0x800, b""),
        transmit(1 << 29, b"", extended=1),
        transmit(0x100, b"", extended=2),
        transmit(0x100, bytes(9)),
        operation(0x10, struct.pack("<IBBH", 0x100, 0, 0, 3) + b"ab"),
        operation(0x99),
        operation(0x20, bytes(3)),
        operation(0x31, bytes(6)),
        struct.pack("<II", 0x20, 7) + bytes(4),
        struct.pack("<II", 0x20, 0xFFFFFFFF) + bytes(4),
    ],
)
def test_an_operation_that_cannot_be_read_comes_back_as_a_format_error(importer, wrong):
    told = struct.pack("<H", len(wrong)) + wrong
    assert importer.told(wrong) == operation(0x01, told)


def test_a_frame_before_a_damaged_operation_counts(importer, periods):
    period = periods[0]
    answer = importer.told(measurements(period) + SYNC + b"\xff")
    error = operation(0x01, b"\1\0\xff")
    assert answer.endswith(error)
    assert frames_of(answer.removesuffix(error)) == Ecu(PRESET).exchange(
        [*period, (FrameId.SYNC, b"")]
    )


def test_what_loses_arbitration_is_sent_again(importer, periods):
    answer = importer.told(measurements(periods[0]) + SYNC)
    command = frames_of(answer)[-1]
    lost = operation(0x30, struct.pack("<I", FrameId.CHARGE_COMMAND))
    assert importer.told(lost) == transmit(*command)
    assert importer.told(operation(0x30, struct.pack("<I", 0x7FF))) == b""


def bus_error(is_sender: int, flag: int = 1) -> bytes:
    return operation(0x31, struct.pack("<IBBB", FrameId.CHARGE_COMMAND, 1, flag, is_sender))


def test_a_sender_of_errors_becomes_passive_leaves_the_bus_and_returns(importer, periods):
    """Error counters of ISO 11898-1: 8 for each error of its own, 1 less for each success."""
    confirmed = operation(0x20, bytes(4))
    assert importer.told(bus_error(1) * 15 + confirmed) == b""
    assert importer.told(bus_error(1)) == b"", "127 is still active"
    assert importer.told(bus_error(1)) == STATUS["passive"]
    assert importer.told(confirmed * 8) == STATUS["active"], "back at 127"
    assert importer.told(bus_error(1) * 17) == STATUS["passive"] + STATUS["off"]
    assert importer.told(measurements(periods[0]) + SYNC) == b"", "nothing leaves it now"
    importer.wait(PERIOD_S)
    answer = importer.told(measurements(periods[1]) + SYNC)
    assert answer.startswith(STATUS["active"]), "128 times 11 bits have passed"
    assert frames_of(answer.removeprefix(STATUS["active"]))


@pytest.mark.parametrize(("flag", "errors_until_passive"), [(1, 16), (2, 128)])
def test_who_sees_an_error_first_pays_more_for_it(importer, flag, errors_until_passive):
    assert importer.told(bus_error(0, flag) * (errors_until_passive - 1)) == b""
    assert importer.told(bus_error(0, flag)) == STATUS["passive"]
    assert importer.told(bus_error(0, flag) * 3) == b""
    assert importer.told(transmit(0x7FF, b"")) == STATUS["active"]


def test_a_state_that_was_kept_comes_back(importer, periods):
    importer.told(measurements(periods[0]) + SYNC)
    importer.wait(PERIOD_S)
    kept = importer.slave.getFMUState()
    answers = [importer.told(measurements(periods[n]) + SYNC) for n in (1, 2)]
    importer.slave.setFMUState(kept)
    assert [importer.told(measurements(periods[n]) + SYNC) for n in (1, 2)] == answers
    importer.slave.freeFMUState(kept)


def test_two_ecus_in_one_process_do_not_know_each_other(ecu_path, periods):
    first, second = Importer(ecu_path), Importer(ecu_path)
    alone = first.told(measurements(periods[0]) + SYNC)
    assert second.told(SYNC) != alone
    assert first.told(measurements(periods[1]) + SYNC) != b""
    fresh = Importer(ecu_path)
    assert fresh.told(measurements(periods[0]) + SYNC) == alone


@pytest.mark.parametrize(
    ("call", "arguments", "said"),
    [
        ("setBinary", ([RX_DATA], [b"\0"]), "set while its clock is not active"),
        ("setBinary", ([TX_DATA], [b"\0"]), "is the only one to set"),
        ("getBinary", ([RX_DATA],), "is the only one to read"),
        ("setClock", ([TX_DATA], [True]), "no such clock"),
        ("getFloat64", ([TX_DATA],), "time is the only such variable"),
        ("setFloat64", ([0], [1.0]), "nothing can be set"),
        ("setBoolean", ([RX_DATA], [True]), "Can.BusNotifications is the only one"),
        ("getInt32", ([NOTIFICATIONS],), "fmi3GetInt32 failed"),
    ],
)
def test_a_call_that_makes_no_sense_is_an_error_with_a_reason(importer, call, arguments, said):
    with pytest.raises(Exception, match="failed with status 3"):
        getattr(importer.slave, call)(*arguments)
    assert said in (importer.unit.last_message or "fmi3GetInt32 failed")


def test_the_notification_parameter_is_kept(importer):
    assert importer.slave.getBoolean([NOTIFICATIONS]) == [False]
    importer.slave.setBoolean([NOTIFICATIONS], [True])
    assert importer.slave.getBoolean([NOTIFICATIONS]) == [True]


def test_a_unit_without_a_can_network_is_no_ecu(tmp_path):
    plant = written(tmp_path, exported_plant(3))
    with pytest.raises(InputError, match=r"has no variable Can.Rx_Data; give an ECU's unit"):
        DrivenEcu(plant, PERIOD_S)
