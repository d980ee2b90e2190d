"""Every signal of every message, both ways: the codec in C against cantools."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from codegen.can_database import network_version
from tests.firmware.bench import DATABASE, HEALTHY, frame

SINGLE = st.floats(width=32)
MESSAGES = sorted(DATABASE.messages, key=lambda m: (m.name == "ChargeCommand", m.frame_id))
RECEIVED = [m for m in MESSAGES if m.senders == ["PLANT"] and m.length]
TRANSMITTED = [m for m in MESSAGES if m.senders == ["ECU"] and m.name != "BootRefusal"]

MEASUREMENT_FIELDS = {
    "Current": "current_A",
    "Voltage": "voltage_V",
    "SurfaceTemperature": "surface_temperature_K",
    "CoolantTemperature": "coolant_temperature_K",
    "CoolingPower": "cooling_power_W",
    "Request": "request",
    "ReferenceCurrent": "reference_current_A",
    "PlugInStateOfCharge": "plug_in_soc",
    "Mode": "mode",
    "TimeToFull": "time_to_full_s",
}
PHYSICAL_FIELDS = {
    "CommandCurrent": "command_A",
    "CoreTemperature": "core_temperature_K",
    "StateOfCharge": "soc",
    "ErrorBound": "error_bound_K",
    "LowerCurrent": "lower_A",
    "UpperCurrent": "upper_A",
    "VoltageMargin": "margins.0",
    "SocMargin": "margins.1",
    "CoreMargin": "margins.2",
    "SurfaceMargin": "margins.3",
    "PlannedCurrent": "planned_A",
    "PredictedTimeToFull": "predicted_time_to_full_s",
}
CODE_FIELDS = {
    "CommandState": "state",
    "DiagnosticState": "state",
    "InDomain": "in_domain",
    "ActiveConstraint": "active_constraint",
    "Feasible": "feasible",
    "FirstFault": "first_fault",
    "FaultPage": "fault_page",
    "ModelHash": "model_hash",
    "PresetHash": "preset_hash",
    "FirmwareVersion": "firmware_version",
    "CalibrationContent": "calibration_content",
    "ResetCause": "reset_cause",
    "ResetCount": "reset_count",
    "ReportedMessage": "reported_message",
    "ReportedState": "reported_state",
    "WrongCrcFrames": "reported_counts.wrong_crc",
    "WrongLengthFrames": "reported_counts.wrong_length",
    "RepeatedFrames": "reported_counts.repeated",
    "LostFrames": "reported_counts.lost",
    "ReorderedFrames": "reported_counts.reordered",
}
FAULT_FIELDS = ("active_faults", "latched_faults")
BITS = {"active_faults": 32, "latched_faults": 32, "model_hash": 32, "preset_hash": 16}
BITS |= {"calibration_content": 32}
FIRST_FAULTS = 20
FAULT_AND_VERSION = ("ActiveFaults", "LatchedFaults", "MoreFaults", "NetworkVersion")


def payload_signals(message: Any) -> list[Any]:
    header = (f"{message.name}Crc", f"{message.name}Counter")
    return [s for s in message.signals if s.name not in header]


def all_ones(signal: Any) -> int:
    return int(2**signal.length) - 1


@st.composite
def reports(draw: st.DrawFn) -> dict[str, Any]:
    """Values for every field of a report, sensible or not."""
    values: dict[str, Any] = {f: draw(SINGLE) for f in PHYSICAL_FIELDS.values()}
    for name in {*CODE_FIELDS.values(), *FAULT_FIELDS}:
        values[name] = draw(st.integers(0, 2 ** BITS.get(name, 8) - 1))
    values["fault_page"] = draw(st.integers(0, 1) | st.integers(0, 255))
    return values


def fault_signals(values: dict[str, Any]) -> dict[str, int]:
    """What the signals with a bit for each fault, and that of the database's version, say."""
    shown = values["active_faults" if values["fault_page"] == 0 else "latched_faults"]
    return {
        "ActiveFaults": values["active_faults"] % 2**FIRST_FAULTS,
        "LatchedFaults": values["latched_faults"] % 2**FIRST_FAULTS,
        "MoreFaults": shown >> FIRST_FAULTS,
        "NetworkVersion": network_version(DATABASE),
    }


def report_in_c(values: dict[str, Any]) -> Any:
    report = ffi.new("codec_report_t *")
    for name, value in values.items():
        target, _, part = name.partition(".")
        if target == "margins":
            report.margins[int(part)] = value
        elif part:
            setattr(getattr(report, target), part, value)
        else:
            setattr(report, name, value)
    return report


def test_every_signal_of_the_database_is_covered_here() -> None:
    sent = {s.name for m in TRANSMITTED for s in payload_signals(m)}
    received = {s.name for m in RECEIVED for s in payload_signals(m)}
    assert sent == {*PHYSICAL_FIELDS, *CODE_FIELDS, *FAULT_AND_VERSION}
    assert received == set(MEASUREMENT_FIELDS)


@given(values=reports())
def test_what_the_ecu_sends_reads_back_with_cantools(values: dict[str, Any]) -> None:
    report, sent = report_in_c(values), ffi.new("can_frame_t *")
    for index, message in enumerate(TRANSMITTED):
        lib.codec_write(index, report, sent)
        assert (sent.id, sent.length) == (message.frame_id, message.length)
        raws = message.decode(
            bytes(ffi.buffer(sent.data, sent.length)), decode_choices=False, scaling=False
        )
        for signal in payload_signals(message):
            raw = raws[signal.name]
            if signal.name in FAULT_AND_VERSION:
                assert raw == fault_signals(values)[signal.name], signal.name
                continue
            if signal.name in CODE_FIELDS:
                assert raw == min(values[CODE_FIELDS[signal.name]], all_ones(signal)), signal.name
                continue
            value, number = values[PHYSICAL_FIELDS[signal.name]], all_ones(signal) - 2
            if not math.isfinite(value):
                assert raw == all_ones(signal), signal.name
            else:
                exact = (min(max(value, -1e6), 1e6) - signal.offset) / signal.scale
                step = 1.0 if signal.name == "CommandCurrent" else 0.5
                assert abs(raw - min(max(exact, 0), number)) <= step + 0.02, signal.name


@given(data=st.data())
@pytest.mark.parametrize("message", RECEIVED, ids=lambda m: m.name)
def test_what_the_ecu_reads_is_what_cantools_reads(message: Any, data: st.DataObject) -> None:
    raws = {
        s.name: data.draw(st.integers(0, all_ones(s)) | st.integers(all_ones(s) - 3, all_ones(s)))
        for s in message.signals
    }
    payload = message.encode(raws, scaling=False, strict=False)
    physical = message.decode(payload, decode_choices=False)
    measurement = ffi.new("codec_measurement_t *")
    lib.codec_read(RECEIVED.index(message), payload, measurement)
    for signal in payload_signals(message):
        value = getattr(measurement, MEASUREMENT_FIELDS[signal.name])
        if signal.unit and raws[signal.name] > all_ones(signal) - 2:
            assert math.isnan(value), signal.name
        else:
            assert value == pytest.approx(physical[signal.name], rel=1e-6, abs=1e-5), signal.name


@pytest.mark.parametrize("message", RECEIVED, ids=lambda m: m.name)
def test_every_message_to_the_ecu_has_exactly_one_row_in_the_receive_table(message: Any) -> None:
    ecu = Ecu("lin2014")
    ecu.receive(*frame(message.name, 0, HEALTHY))
    started = [receiver.has_started for receiver in ecu._state.network.receivers]
    assert started == [other is message for other in RECEIVED]


def test_every_message_of_the_ecu_has_exactly_one_row_in_the_transmit_table() -> None:
    ecu = Ecu("lin2014")
    ecu.step()
    # Who asks for no mode gets a plan too; who wants none does not, see test_charge_mode.py.
    assert [frame_id for frame_id, _ in ecu.transmit()] == [m.frame_id for m in TRANSMITTED]
    assert {m.name for m in MESSAGES} - {m.name for m in (*RECEIVED, *TRANSMITTED)} == {
        "SYNC",
        "BootRefusal",  # see test_boot.py
    }
