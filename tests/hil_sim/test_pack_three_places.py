"""A pack's ECU in three places: this process, one of its own, and a microcontroller in QEMU.

All say the same to the same recorded frames, byte for byte: a charge, and faults of every kind.
"""

from __future__ import annotations

import itertools
import struct
import subprocess
import sys
from dataclasses import replace

import pytest

from bms.errors import BusError, InputError
from bms.model.pair import load_pair
from hil_sim.bus.catalog import ActiveConstraint
from hil_sim.logs import read_log
from hil_sim.logs.recorder import Recorder
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.faults import BEGIN_PERIOD, FAULTS
from hil_sim.pack.frames import FRAME, packed
from hil_sim.pack.places import (
    answers_of_board,
    answers_of_host,
    answers_of_process,
    difference,
    recording,
)
from hil_sim.pack.settings import PackChargeSettings
from tests.firmware.ports import ROOT, needs_emulator

SYNC_ID, COMMAND_ID, DECISION_ID, BLEED_ID = 0x080, 0x280, 0x282, 0x2B0
ON = (50_000).to_bytes(2, "little")
"""Of a bleed resistor, in steps of 2e-5."""
PRESET, MODEL = load_pair("paper_calibrated", None)
FIRMWARE = ROOT / "firmware_c"
PLAYED = (
    "voltage page missing",
    "thermistor wire open",
    "no current reading",
    "voltage page frozen",
)


def recorded(path, settings, fault=None, **options):
    """Frames of each period up to SYNC, and the answers, of the log of a run."""
    if fault is not None:
        options["sent"] = fault_of(fault)
    with Recorder(path) as recorder:
        charge_pack(settings, recorder, **options)
    log = list(read_log(path))
    periods, answers = [], []
    for _, group in itertools.groupby(log, lambda frame: frame.time_s):
        frames = list(group)
        at = next(i for i, frame in enumerate(frames) if frame.frame_id == SYNC_ID)
        periods.append([(f.frame_id, f.data) for f in frames[:at]])
        answers.append([(f.frame_id, f.data) for f in frames[at + 1 :]])
    return periods, b"".join(packed(answer) for answer in answers)


def fault_of(fault):
    now = itertools.count()

    def sent(frames):
        since = next(now) - BEGIN_PERIOD
        if not 0 <= since < 2 or fault.delivery is None:
            return frames
        return [arrived for frame in frames for arrived in fault.delivery(frame, since)]

    return sent


def damage(reading):
    now, kept = itertools.count(), {}

    def tamper(plant):
        since = next(now) - BEGIN_PERIOD
        if 0 <= since < 2:
            reading(plant, since, kept)

    return tamper


def starting_at(**changes):
    return replace(PRESET, initial=replace(PRESET.initial, **changes))


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Name -> settings, periods and the answers that the log has."""
    folder = tmp_path_factory.mktemp("recorded")
    full, hot = starting_at(soc=0.88), starting_at(soc=0.2, temperature_K=315.0)
    resistors = {"bleed_ohm": 10.0, "balance_s": 20.0}
    runs = {
        "charge": (PackChargeSettings(full, MODEL, 5, seed=4, **resistors), None),
        "hot": (PackChargeSettings(hot, MODEL, 5, max_time_s=30.0), None),
    }
    runs |= {
        fault.name: (PackChargeSettings(PRESET, MODEL, 7, max_time_s=20.0), fault)
        for fault in FAULTS
        if fault.name in PLAYED
    }
    runs["192 cells"] = (PackChargeSettings(PRESET, MODEL, 192, max_time_s=4.0), None)
    few = PackChargeSettings(PRESET, MODEL, 16, per_thermistor=4, max_time_s=30.0)
    runs["fewer thermistors"] = (few, None)
    found = {}
    for name, (settings, fault) in runs.items():
        options = {}
        if fault is not None and fault.reading is not None:
            options["tamper"] = damage(fault.reading)
        found[name] = (settings, *recorded(folder / "can.log", settings, fault, **options))
    return found


def governing(answers):
    """Constraints that a run was limited by."""
    codes = {frame[2][2] >> 4 for frame in FRAME.iter_unpack(answers) if frame[0] == DECISION_ID}
    return {ActiveConstraint(code).label for code in codes}


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """pack_answers.c as a process."""
    out = tmp_path_factory.mktemp("answers") / "pack_answers"
    parts = ("include", "src", "generated", "pack", "pack/generated", "pack_ecu", "cost")
    folders = ("src", "generated", "pack", "pack/generated", "pack_ecu")
    sources = [path for part in folders for path in sorted((FIRMWARE / part).glob("*.c"))]
    sources += [
        FIRMWARE / "pack_cost" / "pack_answers.c",
        ROOT / "tests" / "firmware" / "native" / "semihosting_on_host.c",
    ]
    flags = [
        "-std=c99",
        "-O1",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-Wall",
        "-Wextra",
        "-Werror",
    ]
    includes = [f"-I{FIRMWARE / part}" for part in parts]
    subprocess.run(["cc", *flags, *includes, "-o", out, *sources, "-lm"], check=True)
    return out


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    folder = tmp_path_factory.mktemp("board")
    elf = folder / "pack_answers.elf"
    make = ["make", "-s", "-j2", "-f", "firmware_c/pack_cost/pack_cost.mk", f"BUILD={folder}"]
    subprocess.run([*make, f"PYTHON={sys.executable}", str(elf)], cwd=ROOT, check=True)
    return elf


def test_the_recorded_runs_have_a_whole_charge_and_faults_in_it(played):
    assert len(played) == 4 + len(PLAYED)
    assert "voltage" in governing(played["charge"][2])
    assert "core" in governing(played["hot"][2])
    assert any(f[0] == BLEED_ID and f[2][2:4] == ON for f in FRAME.iter_unpack(played["charge"][2]))
    states = [frame[2][4] & 15 for frame in FRAME.iter_unpack(played["charge"][2])
              if frame[0] == COMMAND_ID]  # fmt: skip
    assert sorted(set(states)) == [0, 1, 2, 3, 4], "from the start until it is full"
    for name in PLAYED:
        assert len(played[name][1]) > BEGIN_PERIOD + 20, name


def test_the_host_says_the_same_as_when_it_was_recorded(played):
    for name, (settings, periods, answers) in played.items():
        assert difference(answers_of_host(settings, periods), answers) is None, name


def test_a_process_says_the_same(played, program):
    for name, (settings, periods, answers) in played.items():
        said = answers_of_process(program, recording(settings, periods))
        assert difference(said, answers) is None, name


@needs_emulator
def test_a_microcontroller_says_the_same(played, board):
    for name, (settings, periods, answers) in played.items():
        said = answers_of_board(recording(settings, periods), board)
        assert difference(said, answers) is None, name


def test_a_constant_that_is_off_by_one_in_sixty_thousand_is_found_and_named(played, program):
    settings, periods, answers = played["charge"]
    content = bytearray(recording(settings, periods))
    capacity = struct.pack("<f", settings.core().calibration.rcbf.capacity_As)
    at = content.index(capacity)
    assert content.count(capacity) == 1
    content[at + 1] ^= 1
    found = difference(answers_of_process(program, bytes(content)), answers)
    assert found is not None and found.startswith("frame ")


def test_a_lost_answer_is_a_difference(played):
    _, _, answers = played["charge"]
    assert difference(answers, answers[: -FRAME.size]).endswith(" frames")


@pytest.mark.parametrize("keep", [0, 100, -3])
def test_a_recording_that_is_none_ends_the_program_with_an_error(played, program, keep):
    settings, periods, _ = played["192 cells"]
    content = recording(settings, periods[:3])
    with pytest.raises(BusError, match="has not ended well"):
        answers_of_process(program, content[:keep])


def test_a_program_that_is_not_built_is_refused_with_the_command_that_builds_it(tmp_path):
    with pytest.raises(InputError, match=r"not built; run 'make -f firmware_c/pack_cost"):
        answers_of_board(b"", tmp_path / "none.elf")
