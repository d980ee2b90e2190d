"""The state machine of a message, and what it means for the charge and on the bus."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.firmware._firmware import ffi, lib
from bms.presets import load_preset
from codegen.can_database import load_database, number_attribute
from hil_sim.plant.charger import Charger
from tests.firmware.bench import DATABASE, HEALTHY, MEASURED, READY_PERIODS, RECEIVED, Bench, frame

NO_DATA, INIT, VALID, INVALID = range(4)
LIMITS = st.tuples(st.integers(1, 8), st.integers(0, 8))
PERIODS = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=60)
PERIOD_MS = 100
EVERYTHING_SENT = {**HEALTHY, "Mode": 0}


@dataclass
class Model:
    """The state machine as docs/can.md tells it, over the last periods as (good, bad)."""

    window: int
    init: tuple[int, int]
    valid: tuple[int, int]
    invalid: tuple[int, int]
    state: int = NO_DATA
    past: deque[tuple[bool, bool]] = field(default_factory=deque)

    def period(self, good: bool, bad: bool) -> bool:
        """Whether a frame of this period may be used."""
        self.past.append((good, bad))
        last = list(self.past)[-self.window :]
        goods, bads = sum(g for g, _ in last), sum(b for _, b in last)

        def keeps(limits: tuple[int, int]) -> bool:
            return goods >= limits[0] and bads <= limits[1]

        if self.state == NO_DATA:
            self.state = INIT if good else NO_DATA
        elif self.state == INIT:
            if bads > self.init[1]:
                self.state = INVALID
            elif keeps(self.init):
                self.state = VALID
        else:
            now = self.valid if self.state == VALID else self.invalid
            self.state = VALID if keeps(now) else INVALID
        return good and self.state == VALID


@given(window=st.integers(1, 8), init=LIMITS, valid=LIMITS, invalid=LIMITS, periods=PERIODS)
def test_state_and_use_follow_the_described_machine(
    window: int,
    init: tuple[int, int],
    valid: tuple[int, int],
    invalid: tuple[int, int],
    periods: list[tuple[bool, bool]],
) -> None:
    policy = ffi.new("e2e_policy_t *", [3, window, init, valid, invalid])
    receiver, model = ffi.new("e2e_receiver_t *"), Model(window, init, valid, invalid)
    ids, counter = bytes(16), 0
    for good, bad in periods:
        if bad:
            lib.e2e_check(receiver, b"\0", 1, 2, ids, 3)
        if good:
            data = ffi.new("uint8_t[2]")
            lib.e2e_protect(data, 2, ids, counter)
            assert lib.e2e_check(receiver, data, 2, 2, ids, 3) == lib.E2E_OK
            counter += 1
        verdict = lib.e2e_supervise(receiver, policy)
        assert verdict.is_usable == model.period(good, bad)
        assert verdict.is_disturbed == bad
        assert receiver.state == model.state


def reports(bench: Bench, periods: int = 25) -> dict[str, dict[str, Any]]:
    """What the ECU says of each message, by name, within `periods`."""
    found = {}
    for _ in range(periods):
        answer = bench.period()
        if "ReportedMessage" in answer:
            found[RECEIVED[int(answer["ReportedMessage"])]] = {
                name: answer[name] for name in ("ReportedState", *DISTURBANCES)
            }
    return found


DISTURBANCES = {
    "WrongCrcFrames": lambda sent: [(sent[0], bytes([sent[1][0] ^ 1]) + sent[1][1:])],
    "WrongLengthFrames": lambda sent: [(sent[0], sent[1][:-1])],
    "RepeatedFrames": lambda sent: [sent, sent],
    "LostFrames": lambda sent: [],
    "ReorderedFrames": None,
}


@pytest.mark.parametrize("name", RECEIVED)
@pytest.mark.parametrize("kind", DISTURBANCES)
def test_a_disturbance_is_reported_for_its_message_and_kind_only(name: str, kind: str) -> None:
    bench = Bench(values=dict(EVERYTHING_SENT))
    bench.start()
    sent = frame(name, bench.counters[name], bench.values)
    make = DISTURBANCES[kind]
    if make is None:
        older = frame(name, bench.counters[name] - 2, bench.values)
        bench.period(replace={name: [sent, older]})
    else:
        bench.period(replace={name: make(sent)})
    found = reports(bench)
    # A frame that cannot be read is also missing in the sequence of those that can.
    follow = {"LostFrames"} if kind.startswith("Wrong") else set()
    assert set(found) == set(RECEIVED)
    for message, report in found.items():
        counted = {n for n in DISTURBANCES if report[n]}
        assert counted == ({kind} | follow if message == name else set())
        assert all(report[n] == 1 for n in counted)
        assert report["ReportedState"] == VALID


@pytest.mark.parametrize("name", RECEIVED)
def test_silence_makes_a_message_invalid_and_its_return_valid_again(name: str) -> None:
    bench = Bench(values=dict(EVERYTHING_SENT))
    bench.start()
    for _ in range(5):
        bench.period(drop=(name,))
    silent = reports_while_dropping(bench, name)
    assert silent[name]["ReportedState"] == INVALID
    assert {silent[other]["ReportedState"] for other in RECEIVED if other != name} == {VALID}
    assert reports(bench, 35)[name]["ReportedState"] == VALID


def reports_while_dropping(bench: Bench, name: str) -> dict[str, dict[str, Any]]:
    found = {}
    for _ in range(25):
        answer = bench.period(drop=(name,))
        if "ReportedMessage" in answer:
            found[RECEIVED[int(answer["ReportedMessage"])]] = dict(answer)
    return found


@pytest.mark.parametrize("name", MEASURED)
def test_two_lost_periods_are_forgiven_and_give_no_current_meanwhile(name: str) -> None:
    bench = Bench()
    bench.start()
    for _ in range(2):
        bench.period(drop=(name,))
        assert bench.command_A == 0.0
    bench.period()
    assert (bench.state, bench.latched()) == ("Charging", set())
    assert bench.command_A < 0.0


@pytest.mark.parametrize("name", MEASURED)
def test_a_message_that_comes_every_other_period_only_is_a_fault(name: str) -> None:
    """No three periods in a row are silent, but the message cannot be relied on."""
    bench = Bench()
    bench.start()
    for period in range(10):
        bench.period(drop=(name,) if period % 2 == 0 else ())
    assert bench.state == "Fault"
    assert MEASURED.index(name) in bench.latched()


@pytest.mark.parametrize("name", MEASURED)
def test_a_message_often_damaged_beside_good_ones_is_not_used_any_more(name: str) -> None:
    """Not in three periods in a row, so that only the window sees it."""
    bench = Bench()
    bench.start()
    for period in range(5):
        sent = frame(name, bench.counters[name], bench.values)
        damaged = (sent[0], bytes([sent[1][0] ^ 1]) + sent[1][1:])
        bench.period(replace={name: [damaged, sent] if period != 2 else [sent]})
        assert (bench.command_A == 0.0) == (period >= 3)


def test_messages_of_the_start_are_not_used_before_they_are_valid() -> None:
    bench = Bench(values=dict(EVERYTHING_SENT))
    for _ in range(READY_PERIODS - 1):
        bench.period(Request=0)
        assert not any(bench.ecu._state.network.is_usable)
    bench.period(Request=0)
    assert all(bench.ecu._state.network.is_usable)


def test_a_damaged_state_is_taken_for_invalid() -> None:
    bench = Bench()
    bench.start()
    bench.ecu._state.network.receivers[0].state = 77
    bench.ecu._state.network.receivers[0].good_periods = 0
    bench.period()
    assert bench.command_A == 0.0
    assert bench.ecu._state.network.receivers[0].state == INVALID


def test_time_outs_of_the_database_are_those_in_force() -> None:
    database = load_database()

    def timeout_ms(name: str) -> int:
        message = database.get_message_by_name(name)
        return number_attribute(database, message, "MessageTimeoutTime")

    policies = lib.host_fault_policies()
    for fault, name in enumerate(MEASURED):
        assert policies[fault].stops_at_once
        assert timeout_ms(name) == policies[fault].debounce_periods * PERIOD_MS
    charger = Charger(load_preset("paper_calibrated"))
    assert timeout_ms("ChargeCommand") == charger.silent_periods_to_stop * PERIOD_MS


def test_names_of_faults_states_and_messages_in_the_database_are_the_firmware_s() -> None:
    def names(message: str, signal: str) -> dict[int, str]:
        choices = DATABASE.get_message_by_name(message).get_signal_by_name(signal).choices
        return {int(value): str(name) for value, name in choices.items()}

    def spelled(prefix: str, of: Any) -> dict[int, str]:
        return {v: n.removeprefix(prefix).title().replace("_", "") for v, n in of.items()}

    faults = spelled("FAULT_", ffi.typeof("fault_t").elements)
    assert names("Diagnostics", "FirstFault") == {**faults, lib.FAULT_NONE: "None"}
    states = spelled("BMS_", ffi.typeof("bms_state_t").elements)
    assert names("ChargeCommand", "CommandState") == states
    assert names("Diagnostics", "DiagnosticState") == states
    supervision = spelled("E2E_", ffi.typeof("e2e_state_t").elements)
    assert names("NetworkDiagnostics", "ReportedState") == supervision
    modes = spelled("MODE_", ffi.typeof("codec_mode_t").elements)
    assert names("ChargeMode", "Mode") == {**modes, 15: "NotAvailable"}
    requests = spelled("REQUEST_", ffi.typeof("codec_request_t").elements)
    assert names("ChargeRequest", "Request") == {**requests, 15: "NotAvailable"}
    pages = spelled("FAULT_PAGE_", ffi.typeof("codec_fault_page_t").elements)
    assert names("Diagnostics2", "FaultPage") == pages
    checks = spelled("IMAGE_", ffi.typeof("image_status_t").elements)
    assert {**names("BootRefusal", "FailedCheck"), lib.IMAGE_OK: "Ok"} == checks
    constraints = spelled("RCBF_", ffi.typeof("rcbf_active_t").elements)
    assert names("Decision", "ActiveConstraint") == constraints
    assert names("NetworkDiagnostics", "ReportedMessage") == dict(enumerate(RECEIVED))
