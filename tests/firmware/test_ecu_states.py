"""The ECU application seen from the bus: when it charges, and how a charge ends."""

from __future__ import annotations

from itertools import pairwise

import pytest

from bms.firmware._firmware import lib
from codegen.can_database import network_version
from hil_sim.bus.catalog import Mode
from tests.firmware.bench import DATABASE, HEALTHY, READY_PERIODS, RECEIVED, STATES, Bench, frame


def test_before_all_measurements_came_it_stays_in_init_at_zero() -> None:
    bench = Bench()
    for _ in range(20):
        bench.period(drop=("Coolant",), Request=0)
        assert (bench.state, bench.command_A) == ("Init", 0.0)
    bench.get_ready()
    assert bench.state == "Standby"


def test_init_lasts_until_every_message_came_often_enough() -> None:
    bench = Bench()
    states = [STATES[int(bench.period()["CommandState"])] for _ in range(READY_PERIODS)]
    assert states == ["Init"] * (READY_PERIODS - 1) + ["Standby"]


def test_a_node_that_never_comes_up_is_a_fault_after_start_up() -> None:
    bench = Bench()
    for _ in range(60):
        bench.period(drop=("Coolant",))
    assert bench.state == "Fault"
    assert bench.latched() == {2}


def test_charging_begins_at_the_edge_of_the_request() -> None:
    bench = Bench()
    bench.get_ready()
    assert (bench.state, bench.command_A) == ("Standby", 0.0)
    bench.period(Request=1)
    assert bench.state == "Charging"
    assert bench.command_A < 0.0


def test_current_grows_by_the_preset_s_limit_and_shrinks_at_once() -> None:
    bench = Bench()
    bench.start()
    step_A = bench.ecu.preset.limits.current_growth_A_per_s * 0.1
    assert -2.0 * step_A - 0.0021 <= bench.command_A < -step_A
    while bench.command_A > -23.0:
        before_A = bench.command_A
        bench.period()
        grown_A = before_A - bench.command_A
        assert 0.0 < grown_A <= step_A + 0.0021
        assert bench.state == "Charging"
    bench.period(ReferenceCurrent=-3.0)
    assert bench.command_A == pytest.approx(-3.0, abs=0.0021)


def test_what_the_heat_allows_stands_in_for_a_surface_that_reads_colder() -> None:
    bench = Bench()
    before_K = bench.start()["CoreTemperature"]
    for _ in range(10):
        bench.period(SurfaceTemperature=298.2)
        assert bench.answer["ActiveFaults"] == 0
        assert before_K - 0.5 < bench.answer["CoreTemperature"]
    assert bench.command_A < 0.0
    bench.period(SurfaceTemperature=299.4)
    assert bench.answer["CoreTemperature"] > before_K + 0.2


def test_an_ecu_that_starts_in_mid_charge_waits_for_the_edge() -> None:
    """It does not know how much was charged, so the old state of charge must not be taken."""
    bench = Bench()
    for _ in range(30):
        bench.period(Request=1)
        assert bench.command_A == 0.0
    assert bench.state == "Standby"


def test_charge_is_complete_at_the_completion_state_of_charge_and_stays_off() -> None:
    bench = Bench()
    bench.start(PlugInStateOfCharge=0.9895)
    for _ in range(300):
        bench.period()
    assert (bench.state, bench.command_A) == ("Complete", 0.0)
    assert 0.99 <= bench.answer["StateOfCharge"] < 0.9905
    bench.period(Request=0)
    assert bench.state == "Standby"


def test_request_off_ends_the_charge_at_once() -> None:
    bench = Bench()
    bench.start()
    bench.period(Request=0)
    assert (bench.state, bench.command_A) == ("Standby", 0.0)


def test_a_hot_cell_is_derated_and_the_reason_is_on_the_bus() -> None:
    bench = Bench()
    bench.start_at_full_current()
    bench.period(SurfaceTemperature=318.0, CoolantTemperature=312.0)
    assert bench.state == "Derated"
    assert -23.0 < bench.command_A < 0.0
    assert bench.answer["ActiveConstraint"] in (3, 4)
    assert bench.command_A == pytest.approx(bench.answer["LowerCurrent"], abs=0.0021)


def test_without_a_safe_current_it_commands_zero_and_says_infeasible() -> None:
    bench = Bench()
    bench.start()
    bench.period(SurfaceTemperature=323.5, CoolantTemperature=322.0)
    assert (bench.command_A, bench.answer["Feasible"]) == (0.0, 0)
    assert bench.answer["ActiveConstraint"] == 5
    assert bench.state == "Derated"


@pytest.mark.parametrize("mode", [Mode.FASTEST, Mode.FIXED])
@pytest.mark.parametrize(("asked_A", "given_A"), [(-60.0, -23.0), (-5.0, -5.0), (0.0, 0.0)])
def test_reference_is_followed_but_never_beyond_the_preset(
    asked_A: float, given_A: float, mode: Mode
) -> None:
    bench = Bench(values={**HEALTHY, "Mode": float(mode)})
    bench.start_at_full_current(ReferenceCurrent=asked_A)
    assert bench.command_A == pytest.approx(given_A, abs=0.0021)


def test_command_is_rounded_towards_zero() -> None:
    bench = Bench()
    bench.start_at_full_current()
    for surface_K in (313.0, 314.0, 315.005, 316.01, 317.015, 318.0):
        bench.period(SurfaceTemperature=surface_K, CoolantTemperature=305.0)
        if bench.answer["Feasible"]:
            assert bench.command_A >= bench.answer["LowerCurrent"] - 0.0011


@pytest.mark.parametrize("bias_A", [0.0, 0.5, -0.5])
def test_charge_is_counted_from_the_stronger_of_reading_and_command(bias_A: float) -> None:
    bench = Bench()
    bench.start_at_full_current(PlugInStateOfCharge=0.3)
    before = bench.answer["StateOfCharge"]
    for _ in range(200):
        bench.period(Current=bench.command_A + bias_A)
    stronger_A = 23.0 - min(bias_A, 0.0)
    counted = bench.answer["StateOfCharge"] - before
    assert counted == pytest.approx(200 * 0.1 * stronger_A / 8280, abs=4e-5)


def test_a_load_after_the_charge_is_counted_too() -> None:
    """What the cell gives off is believed, so that the voltage goes on to fit the count."""
    bench = Bench()
    bench.start_at_full_current(PlugInStateOfCharge=0.3)
    bench.period(Request=0)
    bench.period()
    bench.follow_command = False
    before = bench.answer["StateOfCharge"]
    cell = bench.ecu.preset.cell
    for _ in range(3000):
        voltage_V = cell.ocv(bench.answer["StateOfCharge"]) - 0.4 * cell.ohmic_resistance_ohm
        bench.period(Current=0.4, Voltage=float(voltage_V))
    assert bench.answer["StateOfCharge"] - before == pytest.approx(-3000 * 0.04 / 8280, abs=4e-5)


def test_every_message_of_the_database_is_received_or_sent() -> None:
    ecu = Bench().ecu
    sent = set()
    for period in range(15):
        ecu.receive(*frame("ChargeMode", period, {"Mode": 0}))  # Fastest, which asks for Plan too
        ecu.step()
        sent |= {DATABASE.get_message_by_frame_id(frame_id).name for frame_id, _ in ecu.transmit()}
    of_the_boot_stage = {"BootRefusal"}
    assert sent | of_the_boot_stage == {m.name for m in DATABASE.messages if m.senders == ["ECU"]}
    assert not sent & of_the_boot_stage
    received = {m.name for m in DATABASE.messages if m.senders == ["PLANT"] and m.length}
    assert received == set(RECEIVED)


def test_identity_names_model_preset_and_versions() -> None:
    bench = Bench()
    answers = [bench.period() for _ in range(10)]
    named = [a for a in answers if "ModelHash" in a]
    assert len(named) == 1
    assert named[0]["ModelHash"] == int(bench.ecu.model.hash[:8], 16)
    assert named[0]["PresetHash"] == int(bench.ecu.preset.hash[:4], 16)
    assert named[0]["FirmwareVersion"] == lib.BMS_FIRMWARE_VERSION
    assert named[0]["NetworkVersion"] == network_version(DATABASE)


def test_faults_active_and_latched_take_turns_in_the_second_message() -> None:
    """There are no faults beyond the first message yet, so some are put into memory by hand."""
    bench = Bench()
    bench.start()
    bench.ecu._state.monitor.latched = 1 << 20 | 1 << 31 | 1 << 5
    answers = [bench.period() for _ in range(40)]
    assert {answer["LatchedFaults"] for answer in answers} == {1 << 5}
    said = {n: (a["FaultPage"], a["MoreFaults"]) for n, a in enumerate(answers) if "FaultPage" in a}
    assert [b - a for a, b in pairwise(said)] == 7 * [5]
    active, latched = (0, 0), (1, 1 | 1 << 11)
    assert list(said.values()) in (4 * [active, latched], 4 * [latched, active])


def test_charge_command_is_the_last_frame_of_every_period() -> None:
    bench = Bench()
    for _ in range(12):
        bench.period()
        bench.ecu.step()
        frames = bench.ecu.transmit()
        assert DATABASE.get_message_by_frame_id(frames[-1][0]).name == "ChargeCommand"
