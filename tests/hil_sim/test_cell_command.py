"""`bms cell`: from a preset to a calibration that charges on a board, and no step twice."""

from __future__ import annotations

import functools
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bms.image import calibration_part
from bms.model.model_file import load_shipped_model
from bms.model.pair import load_pair
from bms.presets import load_preset, preset_path
from bms.verification import verify
from bms.verification.family import verify_family
from hil_sim.chain import steps
from hil_sim.chain.state import load_state
from hil_sim.fault_matrix.matrix import load_matrix
from hil_sim.targets.catalog import find_board
from tests.cycler_recordings import write_cycler
from tests.firmware.ports import built, needs_emulator

PROGRESS = re.compile(r"bms: .*: .*, \d+ s")
STEPS = ["preset", "train", "verify", "charge", "faults", "export", "image"]


@pytest.fixture(scope="module")
def rows():
    """A few faults of many."""
    found = [row for row in load_matrix(None) if row.name.startswith("lost once")]
    assert found
    return found


CERTIFICATES = {}


def certified(preset, model, note):
    """The certificate, made once for all tests of the same preset."""
    if preset.hash not in CERTIFICATES:
        CERTIFICATES[preset.hash] = verify(preset, model, samples=1000)
    return CERTIFICATES[preset.hash]


@pytest.fixture
def quick(monkeypatch, rows):
    """The shipped model in place of a training that makes the same, and a few faults of many."""
    trained = []

    def shipped(preset, settings, progress):
        trained.append(settings.seed)
        model = load_shipped_model("lin2014")
        return replace(model, preset=preset.name, training_hash=preset.training_hash)

    monkeypatch.setattr(steps, "certify", certified)
    monkeypatch.setattr(steps, "model_for_preset", shipped)
    monkeypatch.setattr(steps, "load_matrix", lambda path: rows)
    monkeypatch.setattr(steps, "find_board", no_board)
    return trained


def no_board(name):
    raise steps.InputError("qemu-system-arm: not installed; run 'apt-get install qemu-system-arm'")


def mine(folder: Path, *edits: tuple[str, str]) -> Path:
    """A nearly full cell, so that the charge is short."""
    text = preset_path("lin2014").read_text(encoding="utf-8")
    for old, new in (
        ('name = "lin2014"', 'name = "mine"'),
        ("soc = 0.1\n", "soc = 0.95\n"),
        *edits,
    ):
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def call(bms, *words):
    """Exit code, steps by name and what standard error says."""
    code, out, err = bms("cell", *words, "--jobs", "1", "--json")
    return code, {one["step"]: one for one in json.loads(out)["steps"]} if out else {}, err


def test_from_a_preset_to_a_calibration_and_nothing_twice(bms, quick, tmp_path):
    path, out = mine(tmp_path), tmp_path / "my cell"

    code, taken, _ = call(bms, "--preset", path, "--out", out)

    assert code == 0, taken
    assert list(taken) == STEPS
    assert not any(one["kept"] for one in taken.values())
    assert taken["image"]["not_run"]
    assert "qemu-system-arm: not installed" in taken["image"]["said"]
    files = [name for one in taken.values() for name in one["files"]]
    assert {"preset.toml", "model.json", "verify.json", "calibration.bin"} <= set(files)
    assert all((out / name).is_file() for name in (*files, "report.html"))
    pair = load_pair(out / "preset.toml", out / "model.json")
    assert (out / "calibration.bin").read_bytes() == calibration_part(*pair)
    assert json.loads((out / "charge/summary.json").read_text())["stop_reason"] == "complete"
    before = {name: (out / name).read_bytes() for name in files}

    code, taken, _ = call(bms, "--preset", path, "--out", out)

    assert code == 0
    assert [name for name, one in taken.items() if not one["kept"]] == ["image"]
    assert {name: (out / name).read_bytes() for name in files} == before
    assert len(quick) == 1

    # Another limit: all that depends on it, and the training is anew since the folder's preset is.
    mine(tmp_path, ("max_voltage_V = 3.6", "max_voltage_V = 3.61"))
    code, taken, _ = call(bms, "--preset", path, "--out", out)
    assert code == 0
    assert not any(one["kept"] for one in taken.values())
    assert load_preset(out / "preset.toml").limits.max_voltage_V == 3.61


def test_a_file_that_is_missing_or_changed_is_made_again_and_nothing_else(bms, quick, tmp_path):
    path, out = mine(tmp_path), tmp_path / "out"
    assert call(bms, "--preset", path, "--out", out)[0] == 0
    (out / "calibration.bin").unlink()
    (out / "verify.json").write_text("{}")

    _, taken, _ = call(bms, "--preset", path, "--out", out)

    # The certificate comes out as it was, so what is behind it stands.
    anew = [name for name, one in taken.items() if not one["kept"]]
    assert anew == ["verify", "export", "image"]
    assert (out / "calibration.bin").is_file()


def test_an_interrupted_step_is_done_anew_and_leaves_nothing_half(
    bms, quick, tmp_path, monkeypatch
):
    path, out = mine(tmp_path), tmp_path / "out"
    run = steps.run_sil

    def interrupted(settings, recorder, progress):
        run(replace(settings, max_time_s=1.0), recorder, progress)
        raise KeyboardInterrupt

    monkeypatch.setattr(steps, "run_sil", interrupted)
    assert bms("cell", "--preset", path, "--out", out, "--jobs", "1")[0] == 130
    assert not (out / "charge").exists()
    assert set(load_state(out).steps) == {"preset", "train", "verify"}

    monkeypatch.setattr(steps, "run_sil", run)
    code, taken, _ = call(bms, "--preset", path, "--out", out)
    assert code == 0
    assert [name for name, one in taken.items() if one["kept"]] == ["preset", "train", "verify"]


def test_a_preset_that_was_edited_in_the_folder_is_not_overwritten(bms, quick, tmp_path):
    path, out = mine(tmp_path), tmp_path / "out"
    assert call(bms, "--preset", path, "--out", out)[0] == 0
    own = out / "preset.toml"
    own.write_text(own.read_text().replace("max_voltage_V = 3.6\n", "max_voltage_V = 3.62\n"))

    code, _, err = call(bms, "--preset", path, "--out", out)
    assert (code, err.count("\n")) == (2, 1)
    assert f"--preset {own}" in err
    assert "3.62" in own.read_text()

    code, taken, _ = call(bms, "--preset", own, "--out", out)
    assert code == 0
    assert "3.62" in own.read_text()
    assert not taken["train"]["kept"]


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (("capacity_Ah = 2.3", 'capacity_Ah = ""'), "cell.capacity_Ah: is empty; "),
        (("capacity_Ah = 2.3", "capacity_Ah = 2300.0"), "cell.capacity_Ah: 2300 A h is more than"),
        (("max_core_temperature_K = 323.0", "max_core_temperature_K = 50.0"), "max_core_temperat"),
        (("max_voltage_V = 3.6", "max_voltage_V = 3.3"), "the charge is never complete"),
        (("cooling_power_W = 1.0", "cooling_power_W = 5.0"), "no charge begins"),
    ],
)
def test_a_preset_that_leads_to_no_charge_is_refused_before_anything_is_trained(
    bms, quick, tmp_path, edit, said
):
    code, taken, err = call(bms, "--preset", mine(tmp_path, edit), "--out", tmp_path / "out")
    assert (code, taken, err.count("\n")) == (2, {}, 1)
    assert said in err
    assert quick == []
    assert not (tmp_path / "out" / "preset.toml").exists()


def test_a_certificate_with_which_no_charge_would_end_stops_the_chain(bms, quick, tmp_path):
    """The open-circuit voltage at 0.99 is 3.440 V: above it, but not by the margin."""
    edit = ("max_voltage_V = 3.6", "max_voltage_V = 3.4402")
    code, taken, _ = call(bms, "--preset", mine(tmp_path, edit), "--out", tmp_path / "out")
    assert code == 1
    assert list(taken) == ["preset", "train", "verify"]
    assert "raise limits.max_voltage_V to" in taken["verify"]["said"]
    assert not (tmp_path / "out" / "calibration.bin").exists()
    assert "stopped at verify" in (tmp_path / "out" / "report.html").read_text()


def test_a_charge_that_crosses_a_limit_stops_the_chain(bms, quick, tmp_path, monkeypatch):
    run = steps.run_sil

    def crossed(settings, recorder, progress):
        result = run(settings, recorder, progress)
        summary = replace(result.summary, violations=("core 324 K over 323 K",))
        return replace(result, summary=summary)

    monkeypatch.setattr(steps, "run_sil", crossed)
    code, taken, _ = call(bms, "--preset", mine(tmp_path), "--out", tmp_path / "out")
    assert code == 1
    assert list(taken) == STEPS[:4]
    assert "324 K over 323 K" in taken["charge"]["said"]


@pytest.mark.parametrize(("reds", "passed"), [(1, True), (2, True), (3, False)])
def test_a_row_on_clocks_is_played_again_alone_where_the_machine_was_late(
    monkeypatch, reds, passed
):
    """Twice at most; any other red row stands at once."""
    clocks = next(row for row in load_matrix(None) if row.realtime)
    other = load_matrix(None)[0]
    played = []

    def verdict(row, failures):
        return SimpleNamespace(row=row, passed=not failures, failures=failures)

    def play(settings, row):
        played.append(row.name)
        return verdict(row, ("no current again in period 12",) if len(played) < reds else ())

    first = [verdict(clocks, ("no current",)), verdict(other, ())]
    monkeypatch.setattr(steps, "play", play)
    found, again = steps._in_time(None, first)
    assert [one.passed for one in found] == [passed, True]
    assert again == ((clocks.name,) if passed else ())
    assert played == [clocks.name] * min(reds, 2)

    played.clear()
    found, again = steps._in_time(None, [verdict(other, ("red",))])
    assert (found[0].failures, again, played) == (("red",), (), [])


def test_without_anything_to_start_from_it_is_told_what_to_give(bms, tmp_path):
    code, _, err = bms("cell", "--out", tmp_path / "out")
    assert (code, err.count("\n")) == (2, 1)
    assert "--preset" in err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"\x90LOGG\xff\xfe", "utf-8"),
        (b"(0.1) vcan0 100#0011\n", "column time_s"),
        (
            b"time_s,current_A,cooling_power_W,surface_temperature_K,coolant_temperature_K,"
            b"core_temperature_K\n" + b"".join(b"%d,1,0,25,24,26\n" % row for row in range(9)),
            "likely degrees Celsius",
        ),
    ],
    ids=["blf", "candump", "measured core in degC"],
)
def test_a_file_that_is_no_such_recording_is_refused_with_its_own_cause(bms, tmp_path, text, said):
    path = tmp_path / "foreign.csv"
    path.write_bytes(text)
    code, _, err = bms("cell", path, "--out", tmp_path / "out")
    assert (code, err.count("\n")) == (2, 1)
    assert said in err


@needs_emulator
@pytest.mark.slow
def test_the_calibration_charges_on_the_emulated_board(bms, quick, tmp_path, monkeypatch):
    build = built("mps2_an386").parent
    monkeypatch.setattr(steps, "find_board", lambda name: find_board(name, build))
    code, taken, _ = call(bms, "--preset", mine(tmp_path), "--out", tmp_path / "out")
    assert code == 0
    assert "frame by frame as on this computer" in taken["image"]["said"]
    logs = [(tmp_path / "out" / where / "can.log").read_bytes() for where in ("charge", "image")]
    assert logs[0] == logs[1]


SIGNS = ("--temperature-unit", "degC", "--charge-positive")
COLUMNS = ("--columns", "time=0,current=1,voltage=2,surface=3,ambient=4")
RATED = (
    "--geometry", "26650", "--rated", "max_charge_A=9.2", "--rated", "max_voltage_V=3.6",
    "--rated", "charge_temperature_degC=0..50",
)  # fmt: skip
CELL = load_preset("lin2014").cell


def pulses_A(time_s: float) -> float:
    """A pulse of 40 s in 400 s, and a short one that charges."""
    within_s = time_s % 400.0
    return 2.0 * CELL.capacity_Ah if within_s < 40.0 else -1.0 if 200.0 <= within_s < 210.0 else 0.0


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Slow discharge, a fast one, pulses: files without a header, of the project's own cell."""
    folder, hour_A = tmp_path_factory.mktemp("cycler"), CELL.capacity_Ah
    return [
        write_cycler(folder / "slow.csv", CELL, lambda time_s: hour_A / 10.0, 20.0, seed=1),
        write_cycler(folder / "fast.csv", CELL, lambda time_s: 3.0 * hour_A, 1.0, seed=2),
        write_cycler(folder / "pulses.csv", CELL, pulses_A, 1.0, seed=3),
    ]


@pytest.mark.slow
def test_from_recordings_to_a_calibration(bms, quick, recordings, tmp_path, monkeypatch):
    def family_model(preset, settings, progress):
        model = load_shipped_model("a123_26650")
        return replace(model, preset=preset.name, training_hash=preset.training_hash)

    few = functools.partial(verify_family, samples=200)
    monkeypatch.setattr(steps, "model_for_preset", family_model)
    monkeypatch.setattr(steps, "verify_family", few)
    out = tmp_path / "my cell"

    code, taken, _ = call(bms, *recordings, *COLUMNS, *SIGNS, *RATED, "--out", out)

    assert code == 0, taken
    assert list(taken) == ["identify", *STEPS[1:]]
    preset = load_preset(out / "preset.toml")
    assert preset.name == "my cell"
    assert preset.limits.reference_current_A == -9.2
    interval = preset.cell.interval
    assert interval is not None
    low, high = (preset.cell.capacity_Ah * factor for factor in interval.capacity)
    assert low < CELL.capacity_Ah < high
    assert (out / "calibration.bin").is_file()
    assert "fast.csv" in (out / "identify.txt").read_text()
    # The same again is nothing to do; a recording with one more row is another one.
    _, taken, _ = call(bms, *recordings, *COLUMNS, *SIGNS, *RATED, "--out", out)
    assert [name for name, one in taken.items() if not one["kept"]] == ["image"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*COLUMNS, "--charge-positive", *RATED), "likely degrees Celsius"),
        ((*COLUMNS, "--temperature-unit", "degC", *RATED), "current_A"),
        (("--columns", "time=0,current=1,voltage=4,surface=3", *SIGNS, *RATED), "voltage"),
        (("--columns", "time=0,current=1,voltage=9", *SIGNS, *RATED), "9"),
        ((*SIGNS, *RATED), "columns"),
        ((*COLUMNS, *SIGNS, "--geometry", "26650", "--rated", "max_charge=4"), "max_charge"),
        ((*COLUMNS, *SIGNS, *RATED, "--preset", "lin2014"), "give one of both"),
    ],
)
def test_wrong_inputs_are_refused_at_once_with_their_cause(
    bms, quick, recordings, tmp_path, words, said
):
    code, taken, err = call(bms, *recordings, *words, "--out", tmp_path / "out")
    # A busy machine takes long enough to say how far it is.
    told = [line for line in err.splitlines() if not PROGRESS.fullmatch(line)]
    assert (code, taken, len(told)) == (2, {}, 1), err
    assert said in told[0]
    assert quick == []
    assert not (tmp_path / "out" / "preset.toml").exists()


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda table: table[:350], "the recordings give a cell that is none"),
        (lambda table: table * [1, 1, 0, 1, 1] + [0, 0, 3.3, 0, 0], "voltage moves by 0 V"),
        (lambda table: table * [1 / 60, 1, 1, 1, 1], "slowest of them goes from full to empty"),
        (lambda table: table * [1, 0, 1, 1, 1], "give a charge or discharge of the whole cell"),
        (lambda table: table[:9], "give a charge or discharge of the whole cell"),
    ],
    ids=["a fraction of a cell", "flat voltage", "time in minutes", "no current", "nine rows"],
)
def test_thin_or_wrong_recordings_are_refused_with_cause_and_remedy(
    bms, quick, tmp_path, edit, said
):
    folder = tmp_path / "cycler"
    folder.mkdir()
    slow = write_cycler(folder / "slow.csv", CELL, lambda time_s: CELL.capacity_Ah / 10, 10.0, 1)
    np.savetxt(slow, edit(np.loadtxt(slow, delimiter=",")), delimiter=",", fmt="%.5f")
    code, taken, err = call(bms, slow, *COLUMNS, *SIGNS, *RATED, "--out", tmp_path / "out")
    told = [line for line in err.splitlines() if not PROGRESS.fullmatch(line)]
    assert (code, taken, len(told)) == (2, {}, 1), err
    assert f"{slow}: " in told[0] and said in told[0]
    assert quick == []
    assert not (tmp_path / "out" / "preset.toml").exists()
