"""A replay answers what was recorded, and shows where it does not."""

import json
import shutil

import pytest

from bms.errors import InputError
from bms.firmware import Ecu
from bms.model.model_file import load_model, shipped_model_path
from bms.presets import load_preset, preset_path
from hil_sim.bus.catalog import NETWORK_VERSION
from hil_sim.bus.database import load_codecs
from hil_sim.logs import LogFrame, LogWriter, read_log
from hil_sim.logs.recorder import Recorder
from hil_sim.replay.comparison import compare
from hil_sim.replay.engine import replay, write_replayed
from hil_sim.replay.identity import choose_pair
from hil_sim.replay.recording import load_recording
from hil_sim.replay.signals import Signals
from hil_sim.run.session import run_both, run_on_clocks
from hil_sim.run.settings import Settings
from tests.hil_sim.golden.record import FOLDER

START, LAGGED = FOLDER / "charge_start.log.gz", FOLDER / "lagged_model.log.gz"
SYNC, THERMAL, COMMAND, IDENTITY = 0x080, 0x101, 0x180, 0x185


def rewrite(path, change, source=START):
    """The golden log with its list of frames changed."""
    frames = list(read_log(source))
    with LogWriter(path) as writer:
        for frame in change(frames):
            writer.write(frame)
    return path


def without(*frame_ids):
    return lambda frames: [frame for frame in frames if frame.frame_id not in frame_ids]


def replayed(path, preset="paper_calibrated"):
    recording = load_recording(path)
    answers = replay(recording, Ecu(preset))
    return compare(recording, Signals(recording.database), recording.answers, answers)


# --- Periods -------------------------------------------------------------------------------------


def test_a_period_is_what_came_before_a_sync_and_what_was_answered_after():
    recording = load_recording(START)
    assert recording.lock_step
    assert len(recording.periods) == 250
    for number, period in enumerate(recording.periods):
        assert period.time_s == round(0.1 * number, 6)
        assert [frame.frame_id for frame in period.received] == [0x100, 0x101, 0x102, 0x103, SYNC]
        assert period.answer[-1].frame_id == COMMAND


def test_without_sync_an_answer_ends_a_period(tmp_path):
    path = rewrite(tmp_path / "can.log", without(SYNC))
    recording = load_recording(path)
    assert not recording.lock_step
    assert recording.answers == load_recording(START).answers
    assert replayed(path).is_equal


def test_what_comes_between_the_frames_of_an_answer_belongs_to_the_next_period(tmp_path):
    def interleave(frames):
        frames = without(SYNC)(frames)
        for n in range(len(frames) - 1, 0, -1):
            if frames[n].frame_id == 0x100 and frames[n - 1].frame_id == COMMAND:
                early = frames[n]._replace(time_s=frames[n - 1].time_s)
                frames[n - 1 : n + 1] = [early, frames[n - 1]]
        return frames

    assert replayed(rewrite(tmp_path / "can.log", interleave)).is_equal


def test_a_run_on_two_clocks_replays(tmp_path, preset):
    path = tmp_path / "can.log"
    with Recorder(path) as recorder:
        run_on_clocks(Settings(preset, bus="virtual:replay", max_time_s=0.5), recorder)
    recording = load_recording(path)
    assert not recording.lock_step
    assert len(recording.periods) >= 5
    assert replayed(path).is_equal


def test_foreign_frames_change_nothing(tmp_path):
    def mixed(frames):
        for frame in frames:
            yield LogFrame(frame.time_s, 0x555, b"\x01")
            yield LogFrame(frame.time_s, frame.frame_id, frame.data, is_extended=True)
            yield frame

    assert replayed(rewrite(tmp_path / "can.log", mixed)).is_equal


# --- Logs that cannot be replayed ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda frames: [LogFrame(0.0, 0x123, b"\x01")], "foreign"),
        (lambda frames: [frame._replace(data=frame.data[:-1] + b"x") for frame in frames]
         [:5], "foreign"),
        (without(*range(0x180, 0x190)), "no ChargeCommand"),
        (lambda frames: frames[8:], "begins in the middle of a run"),
        (lambda frames: without(SYNC)(frames)[500:], "begins in the middle of a run"),
        (lambda frames: frames[:-1], "cut off in the middle of a control period"),
        (without(IDENTITY), "no Identity"),
        (lambda frames: [f._replace(data=bytes(7) + bytes([NETWORK_VERSION]))
                         if f.frame_id == IDENTITY else f for f in frames],
         "preset of hash 0000..."),
        (lambda frames: [f._replace(data=bytes(8)) if f.frame_id == IDENTITY else f
                         for f in frames], "recorded with version 1 of the CAN database"),
        (lambda frames: [f._replace(data=bytes(4) + f.data[4:]) if f.frame_id == IDENTITY else f
                         for f in frames], "model of hash 00000000..."),
        (lambda frames: frames[::-1], None),
    ],
)  # fmt: skip
def test_log_that_cannot_be_replayed_is_refused_in_one_line(bms, tmp_path, change, said):
    path = rewrite(tmp_path / "can.csv", change)
    code, out, err = bms("replay", path)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith(f"bms: {path}: ")
    assert (said or "time goes back") in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["not-there.log"], "not-there.log: no such file"),
        (["README.md"], "use one of .log"),
        ([START, "--preset", "unheard-of"], "paper_calibrated"),
        ([START, "--model", "not-there.json"], "not-there.json"),
        ([START, "--out", "/proc/not/writable.log"], "/proc/not"),
        ([START, "--out", "somewhere.txt"], "use one of .log"),
        ([START, "--out", "x.log", "--against", ".", "."], "--out"),
        ([START, "--against", ".", "."], "not a folder"),
        ([FOLDER.parent, "--against", ".", "."], "no log is in it"),
        ([FOLDER, "--against", ".", "docs"], "docs: not a build"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(bms, arguments, said):
    code, out, err = bms("replay", *arguments)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert said in err


# --- What the firmware is ------------------------------------------------------------------------


def test_the_log_names_the_model(bms):
    code, out, _ = bms("replay", LAGGED, "--json")
    content = json.loads(out)
    assert code == 0
    lagged = shipped_model_path("paper_calibrated", lagged=True)
    assert json.loads(lagged.read_text())["hash"].startswith(content["model_hash"])


def test_a_preset_that_does_not_ship_is_given_as_a_file(bms, tmp_path, preset):
    text = preset_path("paper_calibrated").read_text().replace("soc = 0.0001", "soc = 0.25")
    mine, path = tmp_path / "mine.toml", tmp_path / "can.log"
    mine.write_text(text)
    settings = Settings(load_preset(str(mine)), bus="virtual:mine", max_time_s=3.0)
    with Recorder(path) as recorder:
        run_both(settings, recorder)
    with pytest.raises(InputError, match="give it as --preset FILE"):
        choose_pair(load_recording(path), None, None)
    code, out, _ = bms("replay", path, "--preset", mine, "--json")
    assert (code, json.loads(out)["identity_compared"]) == (0, True)


def test_another_model_is_tried_without_comparing_identity(bms):
    one, other = (shipped_model_path("paper_calibrated", lagged) for lagged in (False, True))
    code, out, _ = bms("replay", START, "--model", other, "--json")
    content = json.loads(out)
    assert code == 1
    assert content["identity_compared"] is False
    assert content["model_hash"] == load_model(other).hash[:8]
    (bound,) = [entry for entry in content["signals"] if entry["signal"] == "ErrorBound"]
    bounds_K = [load_model(path).error_bound_K for path in (one, other)]
    assert bound["largest_difference"] == pytest.approx(abs(bounds_K[0] - bounds_K[1]), abs=0.0011)
    assert bound["differing_periods"] == content["periods"] == 250
    assert not {"ModelHash", "PresetHash"} & {entry["signal"] for entry in content["signals"]}


# --- Differences ---------------------------------------------------------------------------------


def lose_thermal(frames, period=60):
    return [f for f in frames if not (f.frame_id == THERMAL and f.time_s == round(period * 0.1, 6))]


def test_the_first_difference_comes_with_both_sides_inputs_and_decisions(bms, tmp_path):
    path = rewrite(tmp_path / "can.log", lose_thermal)
    code, out, _ = bms("replay", path, "--json")
    content = json.loads(out)
    first = content["first_difference"]
    assert code == 1
    assert (content["equal"], first["period"], first["time_s"]) == (False, 60, 6.0)
    assert {"Current_A", "Voltage_V", "CoolingPower_W"} <= set(first["received"])
    assert "SurfaceTemperature_K" not in first["received"]
    both_say = {"CoreTemperature_K", "LowerCurrent_A", "UpperCurrent_A", "SurfaceMargin_K_per_s2"}
    both_say |= {"SocMargin_per_s", "DiagnosticState", "StateOfCharge", "CommandCurrent_A"}
    assert both_say <= set(first["log"]) & set(first["replay"])
    assert first["log"]["CommandCurrent_A"] < first["replay"]["CommandCurrent_A"] == 0.0
    assert {"CommandCurrent", "ActiveFaults"} <= set(first["differing_signals"])
    assert content["log_charge_Ah"] > content["replay_charge_Ah"] > 0.0


def test_the_table_shows_names_of_states_and_faults(bms, tmp_path):
    code, out, _ = bms("replay", rewrite(tmp_path / "can.log", lose_thermal))
    assert code == 1
    assert "first difference: period 60, 6.000 s" in out
    assert "ThermalMissing" in out
    assert "charge commanded" in out


def test_largest_differences_are_over_all_periods(tmp_path, database):
    command = database["ChargeCommand"]

    def weaken(frames):
        """Take 1 A off the command in period 100 and 3 A in period 101."""
        for frame in frames:
            period = round(frame.time_s / 0.1)
            if frame.frame_id == COMMAND and period in (100, 101):
                values = command.decode(frame.data)
                values["CommandCurrent"] += {100: 1.0, 101: 3.0}[period]
                data = command.encode(values, command.counter(frame.data))
                yield frame._replace(data=data)
            else:
                yield frame

    comparison = replayed(rewrite(tmp_path / "can.log", weaken))
    assert (comparison.differing_periods, comparison.first.period) == (2, 100)
    assert list(comparison.signals) == ["CommandCurrent"]
    assert comparison.signals["CommandCurrent"].periods == 2
    assert comparison.signals["CommandCurrent"].largest == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda answer: answer[::-1], "order of messages"),
        (lambda answer: answer + answer[-1:], "number of ChargeCommand"),
        (lambda answer: answer[:-1], "CommandCurrent"),
        (lambda answer: (*answer[:-1], answer[-1]._replace(data=b"")), "CommandCurrent"),
        (lambda answer: (*answer, answer[-1]._replace(frame_id=0x7FF)), "counter or CRC of 7FF"),
    ],
)
def test_every_byte_of_an_answer_counts(change, said):
    recording = load_recording(START)
    other = list(recording.answers)
    other[7] = change(other[7])
    comparison = compare(recording, Signals(load_codecs()), recording.answers, other)
    assert (comparison.differing_periods, comparison.first.period) == (1, 7)
    assert said in comparison.first.signals


@pytest.mark.parametrize("kept", [0, 249])
def test_answers_that_are_missing_are_not_taken_for_equal(kept):
    recording = load_recording(START)
    few = recording.answers[:kept]
    for one, other in ((recording.answers, few), (few, recording.answers), (few, few)):
        with pytest.raises(ValueError, match="shorter"):
            compare(recording, Signals(load_codecs()), one, other)


# --- The replayed log ----------------------------------------------------------------------------


def test_the_same_log_gives_the_same_bytes_in_every_format(tmp_path):
    for source in (START, rewrite(tmp_path / "can.blf", list), rewrite(tmp_path / "a.asc", list)):
        for suffix in ("log.gz", "blf", "csv"):
            one, other = tmp_path / f"one.{suffix}", tmp_path / f"other.{suffix}"
            for out in (one, other):
                recording = load_recording(source)
                write_replayed(out, recording, replay(recording, Ecu("paper_calibrated")))
            assert one.read_bytes() == other.read_bytes()


def test_an_equal_replay_is_the_log_again(bms, tmp_path):
    out = tmp_path / "new" / "again.log"
    assert bms("replay", START, "--out", out)[0] == 0
    assert list(read_log(out)) == list(read_log(START))


def test_a_run_is_recorded_in_the_format_of_the_suffix(bms, tmp_path):
    log, plain = tmp_path / "logs" / "run.asc.gz", tmp_path / "run" / "can.log"
    run = ("sil", "--max-time-s", 5, "--json")
    assert bms(*run, "--out", plain.parent, "--log", log)[0] == 1
    assert list(read_log(log)) == list(read_log(plain))
    assert bms("replay", log)[0] == 0
    with_log = plain.read_bytes()
    shutil.rmtree(plain.parent)
    assert bms(*run, "--out", plain.parent)[0] == 1
    assert plain.read_bytes() == with_log


@pytest.mark.parametrize("name", ["can.txt", "/proc/not/writable.log"])
def test_a_log_that_cannot_be_written_is_refused_before_the_run(bms, tmp_path, name):
    code, out, err = bms("sil", "--log", tmp_path / name)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert str((tmp_path / name).parent) in err
    assert "writing" not in err
    assert list(tmp_path.iterdir()) == []


def test_help_explains_and_gives_an_example(bms):
    code, out, _ = bms("replay", "--help")
    assert code == 0
    assert "Example: bms replay" in out
