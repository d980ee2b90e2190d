"""One firmware in three places: host, native process on vcan, and microcontrollers in QEMU.

All have to say the same, byte for byte. How a difference is found and named is tested with targets
that differ in one bit.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from bms.errors import BusError, InputError
from bms.firmware import Ecu
from bms.model.model_file import shipped_model_path
from bms.model.pair import load_pair
from codegen.can_database import load_database
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.fault_matrix.runner import MatrixSettings
from hil_sim.replay.engine import replay
from hil_sim.targets.agreement import agreements_with_host
from hil_sim.targets.catalog import NAMES, LinuxTarget, QemuTarget
from hil_sim.targets.remote import RemoteEcu
from hil_sim.targets.scenarios import (
    FULL_CHARGE,
    load_scenarios,
    record_scenarios,
    why_not_played,
)
from tests.firmware.ports import ROOT, build_variant, built, needs_emulator
from tests.hil_sim.golden.record import FOLDER, SCENARIOS
from tests.hil_sim.lines import Line
from tests.hil_sim.test_faults_matrix import ROWS
from tests.hil_sim.test_vcan import HAS_GUEST, HAS_VCAN, MISSING
from tools.long_checks import load_checks

HAS_BOARDS = not needs_emulator.args[0]
HAS_LINUX = HAS_VCAN or HAS_GUEST or "CI" in os.environ
needs_vcan = pytest.mark.skipif(not HAS_LINUX, reason=MISSING)
SEED = 5
SOFT_FLOAT, HARD_FLOAT = "mps2_an385", "mps2_an386"
# A process has the calibration that it was compiled with; images get that of the log.
OTHER_CALIBRATION = ("lagged_model", "lin2014_hot")
FAULTS = (
    "lost once: CellThermal",
    "lost for good: ChargeRequest",
    "two frames swapped: CellThermal",
    "corrupted for good: CellElectrical byte 3",
    "wrong length: Coolant, length 3",
    "bus off for a second",
    "flood at full load: between",
    "sensor not available: surface_temperature_K",
    "current sensor disagrees with the command: offset 3.0",
    "charger ignores commands",
)
# All rows take a quarter of an hour: results/three-places.json has them, here is a choice.
PLAYED = [row for row in ROWS if row.name in FAULTS]
WHOLE = next(check for check in load_checks() if check.name == "three-places")
HOT = FOLDER / "hot_derating.log.gz"


def board(port, folder=None):
    image = (folder or built(port)) / "firmware.bin"
    name = port.replace("_", "-")
    return QemuTarget(f"qemu:{name}", name, image)


def linux():
    return LinuxTarget("linux", built("linux") / "bms_ecu")


@pytest.fixture(scope="module")
def charge_and_faults():
    settings = MatrixSettings(*load_pair("paper_calibrated", None), seed=SEED)
    return record_scenarios(settings, PLAYED)


@pytest.fixture(scope="module")
def golden():
    return {name: load_scenarios([FOLDER / f"{name}.log.gz"])[0] for name in SCENARIOS}


@pytest.fixture(scope="module")
def places(charge_and_faults, golden):
    """Every target that there is on this machine with what it played.

    The full charge of the microcontroller with floating point is in test_pil, in closed loop.
    """
    charge, *faults = charge_and_faults
    assert charge.name == FULL_CHARGE
    assert len(faults) == len(FAULTS)
    own = [scenario for name, scenario in golden.items() if name not in OTHER_CALIBRATION]
    other = [golden[name] for name in OTHER_CALIBRATION]
    work = []
    if HAS_LINUX:
        work.append((linux(), [*charge_and_faults, *own]))
    if HAS_BOARDS:
        work.append((board(HARD_FLOAT), [*faults, *golden.values()]))
        work.append((board(SOFT_FLOAT), [golden["sensor_fault"], *other]))
    # One after the other: there are as many workers of the tests as cores.
    return {target.name: agreements_with_host([target], played)[0] for target, played in work}


def differing(agreements):
    return {
        one.scenario.name: one.comparison.first.signals
        for one in agreements
        if not one.comparison.is_equal
    }


@needs_vcan
def test_a_native_process_on_vcan_says_the_same(places):
    assert differing(places["linux"]) == {}
    assert len(places["linux"]) == 1 + len(PLAYED) + len(SCENARIOS) - len(OTHER_CALIBRATION)


@needs_vcan
def test_a_native_process_with_another_model_says_the_same(golden, tmp_path, bms):
    model = shipped_model_path("paper_calibrated", lagged=True)
    assert bms("export", "--model", model, "--out", tmp_path / "export")[0] == 0
    folder = build_variant("linux", tmp_path, f"GENERATED={tmp_path / 'export'}")
    target = LinuxTarget("linux", folder / "bms_ecu")
    (agreements,) = agreements_with_host([target], [golden["lagged_model"]])
    assert differing(agreements) == {}


@needs_emulator
def test_a_microcontroller_with_floating_point_says_the_same(places):
    assert differing(places["qemu:mps2-an386"]) == {}
    assert len(places["qemu:mps2-an386"]) == len(PLAYED) + len(SCENARIOS)


@needs_emulator
def test_a_microcontroller_without_floating_point_says_the_same(places):
    assert differing(places["qemu:mps2-an385"]) == {}
    assert len(places["qemu:mps2-an385"]) == 1 + len(OTHER_CALIBRATION)


def test_in_the_kept_result_all_places_say_the_same_in_every_row():
    """That it was made with the sources here is held by tests/test_long_checks.py."""
    said = WHOLE.result()["said"]
    played = [row.name for row in ROWS if not why_not_played(row)]
    assert said["equal"] is True
    assert [scenario["name"] for scenario in said["scenarios"]] == [FULL_CHARGE, *played]
    assert len(played) > 200
    for scenario in said["scenarios"]:
        assert {place: one["equal"] for place, one in scenario["targets"].items()} == dict.fromkeys(
            NAMES, True
        )


@needs_emulator
def test_a_fused_multiply_add_is_found_and_named(tmp_path, bms):
    """The hardware has one; the C standard lets a compiler use it unless told not to."""
    fused = "NUMERICS=-ffp-contract=fast -fno-math-errno"
    build_variant(HARD_FLOAT, tmp_path, fused)
    charge = tmp_path / "charge.log"
    # It takes thousands of periods until one result in single precision crosses a step of the bus.
    assert bms("sil", "--max-time-s", 300, "--log", charge)[0] == 1
    arguments = [charge, "--target", "qemu:mps2-an386", "--build", tmp_path]
    code, out, _ = bms("compare-targets", *arguments, "--json")
    assert code == 1
    (scenario,) = json.loads(out)["scenarios"]
    first = scenario["targets"]["qemu:mps2-an386"]["first_difference"]
    assert first["period"] > 0
    frame = first["frames"][0]
    assert frame["host"] != frame["target"]
    signal = first["differing_signals"][0]
    (key,) = (key for key in first["host"] if key.startswith(signal))
    message = load_database().get_message_by_name(frame["message"])
    step = message.get_signal_by_name(signal).scale
    assert first["host"][key] == pytest.approx(first["target"][key], rel=1e-2, abs=1.5 * step)
    code, out, _ = bms("compare-targets", *arguments)
    assert code == 1
    assert f"charge.log on qemu:mps2-an386: first difference in period {first['period']}" in out
    assert f"frame {frame['id']} {frame['message']}: host {frame['host']}, " in out
    assert f"qemu:mps2-an386 {frame['target']}" in out
    assert f"* {signal} " in out


@needs_emulator
def test_a_constant_that_is_one_bit_off_is_found(tmp_path):
    shutil.copytree(ROOT / "firmware_c", tmp_path / "firmware_c")
    source = tmp_path / "firmware_c" / "generated" / "calibration_default.c"
    text = source.read_text()
    before, after = ".capacity_As = 8280.0f", ".capacity_As = 8284.0f"
    assert before in text, "the mutant no longer applies; bring it up to date"
    source.write_text(text.replace(before, after))
    folder = build_variant(HARD_FLOAT, tmp_path / "build", tree=tmp_path)
    ((agreement,),) = agreements_with_host([board(HARD_FLOAT, folder)], load_scenarios([HOT]))
    assert agreement.comparison.first.signals == ("CalibrationContent",)
    assert "StateOfCharge" in agreement.comparison.signals


@dataclass(frozen=True)
class Altered:
    """The firmware of this process, whose answer in one period is another."""

    change: object
    period: int = 100
    name: str = "altered"

    def require_place(self):
        """Here."""

    def replay(self, recordings):
        for recording in recordings:
            answers = replay(recording, Ecu("paper_calibrated"))
            answers[self.period] = tuple(self.change(list(answers[self.period])))
            yield answers


def flip(position, bit):
    def change(answer):
        data = bytearray(answer[0].data)
        data[position] ^= 1 << bit
        return [Frame(answer[0].frame_id, bytes(data)), *answer[1:]]

    return change


@pytest.mark.parametrize("bit", range(8))
@pytest.mark.parametrize("position", range(8))
def test_every_bit_counts(golden_start, position, bit):
    ((agreement,),) = agreements_with_host([Altered(flip(position, bit))], golden_start)
    (frame,) = agreement.frames
    assert agreement.comparison.first.period == 100
    assert agreement.comparison.differing_periods == 1
    assert (frame.frame_id, frame.message) == (0x181, "Estimate")
    assert frame.host[position] ^ frame.target[position] == 1 << bit
    assert agreement.comparison.first.signals


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda answer: answer[:-1], {"ChargeCommand"}),
        (lambda answer: [*answer, Frame(0x7F0, b"12345678")], {"7F0"}),
        (lambda answer: [answer[0], *answer], set()),
        (lambda answer: answer[::-1], set()),
        (lambda answer: [], {"Estimate", "Decision", "DecisionMargins", "Diagnostics"}),
    ],
    ids=["missing", "additional", "twice", "other order", "silence"],
)
def test_missing_additional_and_reordered_frames_are_differences(golden_start, change, named):
    ((agreement,),) = agreements_with_host([Altered(change)], golden_start)
    assert agreement.comparison.differing_periods == 1
    assert agreement.comparison.first.signals
    assert named <= {frame.message for frame in agreement.frames}


@dataclass(frozen=True)
class Shortened:
    """The firmware of this process, of whose answers some are left out."""

    runs: int
    periods: int
    name: str = "shortened"

    def require_place(self):
        """Here."""

    def replay(self, recordings):
        return [one.answers[: self.periods] for one in recordings][: self.runs]


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (Shortened(0, 250), "target 'shortened': played 0 of 1 runs"),
        (Shortened(1, 0), "target 'shortened': answered 0 of 250 periods of charge_start"),
        (Shortened(1, 249), "target 'shortened': answered 249 of 250 periods of charge_start"),
    ],
)
def test_a_target_that_leaves_runs_or_periods_out_is_an_error(golden_start, target, said):
    with pytest.raises(BusError, match=said):
        agreements_with_host([target], golden_start)


@pytest.mark.parametrize(
    ("name", "built_file", "gone", "said"),
    [
        (NAMES[0], "linux/bms_ecu", ("linux.KERNEL", "linux.INTERFACE"), "user-mode-linux"),
        (NAMES[1], "mps2_an386/firmware.bin", ("qemu.PROGRAM",), "qemu-system-arm"),
    ],
)
def test_a_place_that_is_not_there_is_told_before_anything_is_recorded(
    bms, monkeypatch, tmp_path, name, built_file, gone, said
):
    program = tmp_path / built_file
    program.parent.mkdir()
    program.touch()
    for constant in gone:
        monkeypatch.setattr(f"hil_sim.targets.{constant}", "absent0")
    recorded = []
    monkeypatch.setattr("hil_sim.commands.compare_targets.record_scenarios", recorded.append)
    code, out, err = bms("compare-targets", "--target", name, "--build", tmp_path)
    assert (code, out, recorded) == (2, "", [])
    assert "apt-get install" in err
    assert said in err
    assert len(err.splitlines()) == 1


def test_equal_answers_are_no_difference(golden_start):
    ((agreement,),) = agreements_with_host([Altered(lambda answer: answer)], golden_start)
    assert agreement.comparison.is_equal
    assert agreement.frames == ()


@pytest.fixture(scope="module")
def golden_start():
    return load_scenarios([FOLDER / "charge_start.log.gz"])


def test_only_rows_that_no_recording_can_hold_are_left_out():
    left_out = {row.name.partition(":")[0] for row in ROWS if why_not_played(row)}
    assert left_out == {"ECU restarts", "clock jitter"}


def test_a_target_that_falls_silent_is_an_error_that_names_the_bus(monkeypatch, golden_start):
    monkeypatch.setattr("hil_sim.targets.remote._ANSWER_TIMEOUT_S", 0.05)
    with (
        Line(lambda line: b"") as line,
        open_bus(line.bus) as bus,
        pytest.raises(BusError, match=r"no answer in 0\.05 s"),
    ):
        replay(golden_start[0].recording, RemoteEcu(bus, 0x180))


@needs_vcan
def test_a_program_that_is_no_ecu_is_an_error_in_one_line(golden_start):
    with pytest.raises(BusError, match=r"target 'linux': .*/false: does not say") as caught:
        agreements_with_host([LinuxTarget("linux", Path("/bin/false"))], golden_start)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--target", "esp32"], "choose one of linux, qemu:mps2-an386, qemu:mps2-an385"),
        (["--target", "linux", "--build", "/nowhere"], "run 'make firmware TARGET=linux' first"),
        (["--target", NAMES[1], "--build", "/nowhere"], "'make firmware TARGET=mps2_an386' first"),
        ([HOT, "--rows", "lost"], "leave one of them out"),
        (["/nowhere/can.log"], "/nowhere/can.log"),
    ],
)
def test_wrong_use_is_told_in_one_line(bms, tmp_path, arguments, said):
    if "--build" not in arguments:
        (tmp_path / "linux").mkdir()
        (tmp_path / "linux" / "bms_ecu").touch()
        arguments = [*arguments, "--build", tmp_path]
    if "--target" not in arguments:
        arguments = [*arguments, "--target", "linux"]
    code, out, err = bms("compare-targets", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_log_without_sync_is_refused(tmp_path):
    with gzip.open(HOT, "rt") as lines:
        real_time = [line for line in lines if " 080#" not in line]
    (tmp_path / "clock.log").write_text("".join(real_time))
    with pytest.raises(InputError, match="recorded on the wall clock"):
        load_scenarios([tmp_path / "clock.log"])
