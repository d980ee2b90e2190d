"""The firmware answers the golden logs byte by byte as it did when they were recorded.

There is no switch to update them: see golden/record.py.
"""

import gzip
from itertools import groupby

import pytest

from bms.firmware import Ecu
from hil_sim.replay.comparison import compare
from hil_sim.replay.engine import replay, write_replayed
from hil_sim.replay.identity import choose_pair
from hil_sim.replay.recording import load_recording
from hil_sim.replay.signals import Signals
from tests.hil_sim.golden.record import FOLDER, SCENARIOS

STATES = {
    "charge_start": ["Init", "Standby", "Charging"],
    "lin2014_hot": ["Init", "Standby", "Charging", "Derated"],
    "cold_start": ["Init", "Standby", "Charging"],
    "hot_derating": ["Init", "Standby", "Charging", "Derated"],
    "lagged_model": ["Init", "Standby", *["Charging", "Derated"] * 3],
    "message_loss": ["Init", "Standby", "Charging", "Fault", "Standby", "Charging"],
    "corrupted_frames": ["Init", "Standby", "Charging", "Fault", "Standby", "Charging"],
    "sensor_fault": [
        *("Init", "Standby", "Charging", "Derated", "Charging", "Fault", "Standby", "Charging"),
    ],
    "request_off_on": ["Init", *["Standby", "Charging"] * 3, "Standby"],
    "infeasible": ["Init", "Standby", "Derated"],
    "complete": ["Init", "Standby", "Charging", "Derated", "Complete"],
}
each_scenario = pytest.mark.parametrize("name", SCENARIOS)


@each_scenario
def test_replay_is_byte_identical(tmp_path, name):
    path = FOLDER / f"{name}.log.gz"
    recording = load_recording(path)
    answers = replay(recording, Ecu(*choose_pair(recording, None, None)))

    comparison = compare(recording, Signals(recording.database), recording.answers, answers)

    assert comparison.is_equal, f"run 'bms replay {path}' to see {comparison.first}"
    write_replayed(tmp_path / "again.log", recording, answers)
    assert (tmp_path / "again.log").read_bytes() == gzip.decompress(path.read_bytes())


@each_scenario
def test_scenario_shows_what_its_name_says(name):
    recording = load_recording(FOLDER / f"{name}.log.gz")
    signals = Signals(recording.database)
    states = [signals.text("CommandState", signals.decode(a[-1:])) for a in recording.answers]
    assert [state for state, _ in groupby(states)] == STATES[name]


def test_there_is_a_small_log_for_each_scenario():
    logs = list(FOLDER.glob("*.gz"))
    assert {log.name for log in logs} == {f"{name}.log.gz" for name in SCENARIOS}
    assert sum(log.stat().st_size for log in logs) < 300_000
