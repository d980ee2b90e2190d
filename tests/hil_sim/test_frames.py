"""Every frame of a run, decoded by cantools alone, says what the ECU is specified to do."""

import itertools
from collections import defaultdict
from importlib.resources import files

import can
import cantools
import pytest
from cantools import autosar

from bms.model import load_shipped_model
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

DATABASE = cantools.database.load_string(
    files("codegen").joinpath("can/bms.dbc").read_text(), "dbc"
)
CHARGE_MODE = 4  # as it is reported
PLANT = ["CellElectrical", "CellThermal", "Coolant", "ChargeRequest", "SYNC"]
ECU = ["Estimate", "Decision", "DecisionMargins", "Diagnostics", "ChargeCommand"]
NOW_AND_THEN = ["Identity", "NetworkDiagnostics", "Diagnostics2", "Plan", "Start"]


@pytest.fixture(scope="module")
def run(preset, tmp_path_factory):
    path = tmp_path_factory.mktemp("frames") / "can.log"
    with Recorder(path) as recorder:
        result = run_both(Settings(preset, max_time_s=200.0), recorder)
    with can.LogReader(path) as reader:
        return result, list(reader)


@pytest.fixture(scope="module")
def periods(run):
    """For each control period the decoded messages by name, in the order of the bus."""
    grouped = defaultdict(dict)
    for frame in run[1]:
        message = DATABASE.get_message_by_frame_id(frame.arbitration_id)
        values = message.decode(frame.data, decode_choices=False) if message.signals else {}
        grouped[frame.timestamp][message.name] = values
    return list(grouped.values())


def test_every_period_has_the_same_messages_in_the_same_order(periods):
    for period in periods:
        assert [name for name in period if name not in NOW_AND_THEN] == PLANT + ECU


def test_time_stamps_are_multiples_of_the_control_period(run, preset):
    times = sorted({frame.timestamp for frame in run[1]})
    period_s = preset.timing.sampling_period_s
    assert times == pytest.approx([k * period_s for k in range(len(times))], abs=1e-9)


@pytest.mark.parametrize("name", [*PLANT[:-1], *ECU, "NetworkDiagnostics"])
def test_end_to_end_protection_is_right_on_every_frame(run, name):
    message = DATABASE.get_message_by_name(name)
    data_ids = bytes.fromhex(message.dbc.attributes["E2EProfile2DataIdList"].value)
    payloads = [bytes(f.data) for f in run[1] if f.arbitration_id == message.frame_id]
    counters = [payload[1] & 0xF for payload in payloads]
    for payload, counter in zip(payloads, counters):
        assert autosar.check_profile2_crc(payload, data_ids[counter])
    steps = {(b - a) % 16 for a, b in itertools.pairwise(counters)}
    assert steps == {1}


def test_identity_comes_once_a_second_and_names_model_and_preset(periods, preset):
    at = [k for k, period in enumerate(periods) if "Identity" in period]
    assert {b - a for a, b in itertools.pairwise(at)} == {
        round(1.0 / preset.timing.sampling_period_s)
    }
    identity = periods[at[0]]["Identity"]
    assert identity["ModelHash"] == int(load_shipped_model(preset.name).hash[:8], 16)
    assert identity["PresetHash"] == int(preset.hash[:4], 16)


def test_no_current_is_commanded_unless_charging(periods):
    for period in periods:
        command = period["ChargeCommand"]
        if command["CommandState"] not in (2, 3):
            assert command["CommandCurrent"] == pytest.approx(0.0, abs=1e-9)


def test_the_command_lies_in_the_interval_of_the_decision_and_keeps_its_margins(periods):
    charging = [p for p in periods if p["ChargeCommand"]["CommandState"] in (2, 3)]
    assert len(charging) > 1000
    for period in charging:
        if period["Decision"]["Feasible"] != 1:
            assert period["ChargeCommand"]["CommandCurrent"] == pytest.approx(0.0, abs=1e-9)
            continue
        # The bus rounds each figure to 2 mA.
        assert (
            period["Decision"]["LowerCurrent"] - 0.003
            <= period["ChargeCommand"]["CommandCurrent"]
            <= period["Decision"]["UpperCurrent"] + 0.003
        )


def test_counted_and_true_state_of_charge_agree(run):
    series = run[0].series
    for estimate, truth in zip(series.estimated_soc[5:], series.soc[5:]):
        assert estimate == pytest.approx(truth, abs=5e-4)


def test_no_fault_is_reported(periods):
    assert {period["Diagnostics"]["ActiveFaults"] for period in periods[1:]} == {0}
    assert {period["Diagnostics"]["LatchedFaults"] for period in periods} == {0}


def test_every_message_of_an_undisturbed_run_is_reported_as_valid_without_a_count(periods):
    reports = [p["NetworkDiagnostics"] for p in periods if "NetworkDiagnostics" in p]
    assert [r["ReportedMessage"] for r in reports[:10]] == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]
    needed = [r["ReportedState"] for r in reports[1:] if r["ReportedMessage"] != CHARGE_MODE]
    optional = [r["ReportedState"] for r in reports if r["ReportedMessage"] == CHARGE_MODE]
    assert set(needed) == {2}
    assert set(optional) == {0}  # nobody has sent it
    counts = ("WrongCrcFrames", "WrongLengthFrames", "RepeatedFrames", "LostFrames")
    assert {r[name] for r in reports for name in (*counts, "ReorderedFrames")} == {0}
