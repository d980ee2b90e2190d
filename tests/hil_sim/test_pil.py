"""Processor in the loop: the plant charges its cell against an image on an emulated Cortex-M4F."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from threading import Timer

import pytest

from bms.errors import BusError, InputError, ModelMismatchError
from bms.firmware import Ecu
from bms.identification.preset_toml import preset_toml
from bms.model.model_file import load_model, shipped_model_path
from bms.model.pair import load_pair
from bms.presets import load_preset
from hil_sim.bus.catalog import FrameId, Mode
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.line_losses import LOSS_ID
from hil_sim.run.session import run_both, run_on_clocks, run_plant, run_sil
from hil_sim.run.settings import Settings
from hil_sim.targets import Emulation
from hil_sim.targets.catalog import QemuTarget, find_board
from tests.firmware.ports import ROOT, built, image, needs_emulator
from tests.hil_sim.ecus import IDENTITY_ID
from tests.hil_sim.lines import Line, frame, text

SEED = 5
BOARD = "mps2-an386"


@pytest.fixture(scope="module")
def settings():
    preset, model = load_pair("paper_calibrated", None)
    return Settings(preset, model=model, seed=SEED)


def test_a_report_of_losses_is_known_by_the_identifier_that_the_firmware_gives_it():
    header = (ROOT / "firmware_c" / "port" / "slcan_link.h").read_text()
    assert f"#define SLCAN_LINK_LOSS_ID 0x{LOSS_ID:03X}u\n" in header


@needs_emulator
def test_a_full_charge_over_the_serial_line_gives_the_frames_of_the_virtual_bus(settings, tmp_path):
    with Recorder(tmp_path / "host.log") as recorder:
        expected = run_both(settings, recorder).summary
    with (
        find_board(f"qemu:{BOARD}", built("mps2_an386").parent).start() as board,
        Recorder(tmp_path / "board.log") as recorder,
    ):
        summary = run_sil(replace(settings, bus=board.bus), recorder).summary
    assert (tmp_path / "board.log").read_bytes() == (tmp_path / "host.log").read_bytes()
    assert summary.stop_reason == "complete"
    assert summary.passed
    assert summary.line_losses.total == 0
    other = {"bus": expected.bus, "wall_time_s": expected.wall_time_s, "line_losses": None}
    assert replace(summary, **other) == expected


@needs_emulator
@pytest.mark.parametrize("board", ["mps2-an386", "mps2-an385"])
def test_a_family_is_charged_with_the_same_frames_where_its_calibration_is_flashed(
    bms, board, tmp_path
):
    """Hot, half full and without a plan, so that the core's condition governs within the time."""
    preset, model = load_pair("a123_26650_10C", None)
    initial = replace(preset.initial, soc=0.5, temperature_K=313.0)
    path = tmp_path / "hot.toml"
    path.write_text(preset_toml(replace(preset, name="hot", initial=initial)), encoding="utf-8")
    bms("export", "--preset", path, "--model", shipped_model_path(preset.name), "--out", tmp_path)
    flash = (
        "--image",
        built(board.replace("-", "_")) / "firmware.bin",
        "--flash",
        tmp_path / "flash.bin",
    )
    calibration = ("--calibration", tmp_path / "calibration.bin", "--no-start")
    code, _, err = bms("flash", "--target", f"qemu:{board}", *flash, *calibration)
    assert (code, err) == (0, "")
    settings = Settings(load_preset(path), model=model, seed=SEED, mode=Mode.FIXED, max_time_s=60.0)
    with Recorder(tmp_path / "host.log") as recorder:
        run = run_both(settings, recorder)
    assert "core" in {*run.series.active_constraint}
    with (
        Emulation(tmp_path / "flash.bin", board) as emulated,
        Recorder(tmp_path / "board.log") as recorder,
    ):
        run_sil(replace(settings, bus=emulated.bus), recorder)
    assert (tmp_path / "board.log").read_bytes() == (tmp_path / "host.log").read_bytes()


@needs_emulator
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--model", shipped_model_path("paper_calibrated", lagged=True)],
            "the ECU runs a model with hash",
        ),
        (["--preset", "lin2014"], "the ECU runs a preset with hash"),
    ],
)
def test_an_image_with_another_model_or_preset_is_refused(bms, options, said):
    built("mps2_an386")
    code, out, err = bms("sil", "--target", f"qemu:{BOARD}", *options)
    assert (code, out) == (2, "")
    assert said in err


@needs_emulator
def test_what_the_boot_stage_refuses_is_told(settings, tmp_path):
    damaged = bytearray(image("mps2_an386"))
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "damaged.bin").write_bytes(damaged)
    with (
        Emulation(tmp_path / "damaged.bin", BOARD) as board,
        pytest.raises(BusError, match=r"boot stage refuses the application \(wrong crc\)"),
    ):
        run_sil(replace(settings, bus=board.bus))


@needs_emulator
def test_in_real_time_the_image_steps_on_its_own_clock(bms, tmp_path):
    """Whether the charge goes well depends on how busy this machine is, and is not looked at."""
    built("mps2_an386")
    arguments = ["--target", f"qemu:{BOARD}", "--realtime", "--max-time-s", "1"]
    bms("sil", *arguments, "--log", tmp_path / "can.log", "--json")
    log = (tmp_path / "can.log").read_text()
    assert " 080#" not in log
    assert log.count(" 180#") >= 5


class Serial:
    """The firmware behind a line that can lose its identity and report losses."""

    def __init__(self, settings, losses=b"", losses_at=0, silent_ids=()):
        self._ecu = Ecu(settings.preset, settings.model)
        self._losses, self._losses_at = losses, losses_at
        self.steps = 0
        self._silent_ids = silent_ids

    def answer(self, line):
        """What the line gives back."""
        received = frame(line)
        if received is None:
            return b""
        self._ecu.receive(*received)
        if received[0] != FrameId.SYNC:
            return b""
        self._ecu.step()
        said = [one for one in self._ecu.transmit() if one[0] not in self._silent_ids]
        if self._losses and self.steps == self._losses_at:
            said.append((LOSS_ID, self._losses))
        self.steps += 1
        return b"".join(text(*one) for one in said)


@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_frames_lost_on_the_serial_line_fail_the_run(settings, bms, at):
    last_step = run_both(replace(settings, max_time_s=0.5)).summary.steps - 1
    step = round(at * last_step)
    serial = Serial(settings, losses=b"\x02\0\0\0\x01\x01\0\0", losses_at=step)
    with Line(serial.answer) as line:
        code, out, _ = bms("sil", "--bus", line.bus, "--max-time-s", "0.5", "--json")
    assert code == 1
    assert serial.steps == last_step + 1
    assert json.loads(out)["line_losses"] == {"to_ecu": 2, "from_ecu": 257}


def test_the_losses_are_in_the_table_and_in_words(settings, bms):
    with Line(Serial(settings, losses=b"\x02\0\0\0\x01\0\0\0").answer) as line:
        code, out, _ = bms("sil", "--bus", line.bus, "--max-time-s", "0.5")
    assert code == 1
    assert "Frames lost on the serial line" in out
    assert "the ECU's serial line lost 2 frames to it and 1 from it" in " ".join(out.split())


def test_a_line_without_losses_passes(settings, bms):
    with Line(Serial(settings).answer) as line:
        code, out, err = bms("sil", "--bus", line.bus, "--max-time-s", "0.5", "--json")
    assert code == 1
    assert err.startswith("bms: kan-rcbf-fastest: time ended before the charge")
    assert json.loads(out)["violations"] == []
    assert json.loads(out)["line_losses"] == {"to_ecu": 0, "from_ecu": 0}
    assert json.loads(out)["model_hash"] == settings.model.hash[:8]


def test_an_ecu_that_does_not_name_its_model_does_not_charge(settings):
    with (
        Line(Serial(settings, silent_ids=(IDENTITY_ID,)).answer) as line,
        pytest.raises(BusError, match=r"not ready after 100 periods .*model or content unknown"),
    ):
        run_sil(replace(settings, bus=line.bus))


def test_an_ecu_with_another_model_is_refused_before_current_flows(settings, tmp_path):
    lagged = load_model(shipped_model_path("paper_calibrated", lagged=True))
    with (
        Line(Serial(settings).answer) as line,
        Recorder(tmp_path / "can.log") as recorder,
        pytest.raises(ModelMismatchError, match="give a board that model"),
    ):
        run_sil(replace(settings, bus=line.bus, model=lagged), recorder)
    assert (tmp_path / "can.log").read_text().count(" 080#") == 1


def test_a_baseline_runs_here_beside_the_ecu_at_the_other_end(settings, bms):
    with Line(Serial(settings).answer) as line:
        arguments = ["--baseline", "cc-cv", "--max-time-s", "0.5", "--json"]
        code, out, err = bms("sil", "--bus", line.bus, *arguments)
    assert code == 1
    assert err.startswith("bms: kan-rcbf-fastest: time ended before the charge")
    baseline = json.loads(out)["baseline"]
    assert baseline["bus"] == "virtual:bms"
    assert baseline["line_losses"] is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["sil", "--controller", "s-cbf"], "the ECU at the other end controls"),
        (["sil", "--target", f"qemu:{BOARD}"], "--target brings a bus of its own"),
        (["sil"], "see that an image or adapter listens there"),
        (["plant"], "see that an image or adapter listens there"),
    ],
)
def test_wrong_use_of_a_line_is_told(bms, arguments, said):
    code, out, err = bms(*arguments, "--bus", "slcan:socket://127.0.0.1:1")
    assert (code, out) == (2, "")
    assert said in err


@pytest.mark.parametrize("run", [run_both, run_on_clocks])
def test_plant_and_ecu_cannot_share_one_end_of_a_line(settings, run):
    with pytest.raises(InputError, match="the ECU is at the other; use 'bms sil'"):
        run(replace(settings, bus="slcan:socket://127.0.0.1:1"))


def test_a_fault_inside_the_ecu_cannot_be_made_from_here(bms, tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nkind = "ecu-restarted"\nfrom_s = 1\n')
    code, _, err = bms("sil", "--bus", "slcan:socket://127.0.0.1:1", "--faults", faults)
    assert code == 2
    assert "restart the ECU itself" in err


def test_an_ecu_that_says_nothing_is_told_with_a_remedy(bms):
    with Line(lambda line: b"") as line:
        code, _, err = bms("plant", "--bus", line.bus, "--answer-timeout-s", "0.02")
    assert code == 2
    assert "'bms flash --image FILE --port PORT' starts one" in err


@needs_emulator
@pytest.mark.parametrize("target", ["linux", "qemu:mps2-an999", "mps2-an386"])
def test_a_target_that_is_no_board_is_refused(bms, target):
    code, _, err = bms("sil", "--target", target)
    assert code == 2
    assert f"target '{target}'" in err or "make firmware TARGET=linux" in err


def test_a_board_that_was_not_built_is_told_with_the_command(bms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = bms("sil", "--target", f"qemu:{BOARD}")
    assert code == 2
    assert "run 'make firmware TARGET=mps2_an386' first" in err


def test_the_folder_of_an_image_is_the_one_that_make_writes_to():
    assert Path("build/firmware/mps2_an386").resolve() == built("mps2_an386").resolve()


@needs_emulator
def test_a_board_that_starts_slowly_gets_the_first_period_once(settings, tmp_path):
    """Paused for longer than the plant waits for an answer before it offers the period again."""
    quick = replace(settings, max_time_s=0.5)
    with Recorder(tmp_path / "host.log") as recorder:
        run_both(quick, recorder)
    with (
        Emulation(built("mps2_an386") / "firmware.bin", BOARD) as board,
        Recorder(tmp_path / "slow.log") as recorder,
    ):
        process = board._process.pid
        os.kill(process, signal.SIGSTOP)
        Timer(1.0, os.kill, (process, signal.SIGCONT)).start()
        run_plant(replace(quick, bus=board.bus, answer_timeout_s=0.5), recorder)
    assert (tmp_path / "slow.log").read_bytes() == (tmp_path / "host.log").read_bytes()


@needs_emulator
def test_a_board_without_an_image_is_told(tmp_path):
    (tmp_path / "firmware.bin").write_bytes(b"")
    target = QemuTarget(f"qemu:{BOARD}", BOARD, tmp_path / "firmware.bin")
    with pytest.raises(BusError, match="the board does not start"), target.start():
        pass


@pytest.mark.parametrize(
    ("rule", "commands"),
    [
        ("pil", ("sil --target qemu:mps2-an386 ", " --out out/pil")),
        ("three-places", ("bms compare-targets",)),
    ],
)
def test_the_rule_of_make_builds_the_firmware_and_runs_the_command(rule, commands):
    done = subprocess.run(
        ["make", "-n", rule], cwd=ROOT, capture_output=True, text=True, check=True
    )
    lines = done.stdout.splitlines()
    builds = [n for n, line in enumerate(lines) if "firmware_c/port/" in line]
    (run,) = [n for n, line in enumerate(lines) if all(part in line for part in commands)]
    assert builds
    assert max(builds) < run
