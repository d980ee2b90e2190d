"""A pack's ECU where frames are damaged, too many or too few, or it has no constants."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import cantools.autosar
import pytest

from bms.model.pair import load_pair
from codegen.can_database import PACK, data_ids, load_database
from hil_sim.bus.frame import Frame
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import ffi, lib
from tests.hil_sim.pack_rig import CHARGING, core_of

MESSAGES = {message.frame_id: message for message in load_database(PACK).messages}
ELECTRICAL, COOLANT, REQUEST = 0x200, 0x201, 0x202
VOLTAGES, TEMPERATURES, PLUG_IN = 0x210, 0x220, 0x230
START_UP_PERIODS = 50
Change = Callable[[list[Frame]], list[Frame]]


def bit(*names: str) -> int:
    return sum(1 << getattr(lib, f"FAULT_{name}") for name in names)


def unchanged(frames: list[Frame]) -> list[Frame]:
    return frames


def corrupted(frame_id: int) -> Change:
    """The first frame of a message comes with a wrong checksum."""

    def change(frames: list[Frame]) -> list[Frame]:
        at = next(i for i, frame in enumerate(frames) if frame.frame_id == frame_id)
        good = frames[at]
        bad = good._replace(data=bytes([good.data[0] ^ 1, *good.data[1:]]))
        return [*frames[:at], bad, *frames[at + 1 :]]

    return change


def without(frame_id: int, page: int | None = None) -> Change:
    """Nothing of a message, or of a page of it, comes."""

    def is_lost(frame: Frame) -> bool:
        return frame.frame_id == frame_id and page in (None, frame.data[1] >> 4)

    return lambda frames: [frame for frame in frames if not is_lost(frame)]


class Bench:
    """Plant, wire and ECU of a pack; `ecu.state` is all that the ECU knows."""

    def __init__(self, cells: int = 4, preset: str = "paper_calibrated", **changes: Any) -> None:
        self.settings = PackChargeSettings(*load_pair(preset, None), cells, **changes)
        self.ecu, self.plant = PackEcu(self.settings), PackPlant(self.settings)
        self.wire = PackWire(self.settings, self.plant)
        self.heard: Any = None

    def run(
        self,
        periods: int = 1,
        charge: bool = False,
        change: Change = unchanged,
        request: int | None = None,
    ) -> float:
        """Periods in which frames are changed; the last command in A."""
        for _ in range(periods):
            self.plant.measure()
            frames = change(self.wire.publish(charge, request))
            self.heard = self.wire.hear(self.ecu.exchange(frames))
            self.plant.hold(obeyed_A(self.heard))
        return float(self.ecu.state.command_A)

    @property
    def symptoms(self) -> int:
        """Of the network and of the core."""
        return int(self.ecu.state.monitor.active | self.ecu.state.pack.monitor.active)


def charging(**options: Any) -> Bench:
    bench = Bench(**options)
    bench.run(20)
    assert bench.run(20, charge=True) < 0.0
    assert bench.symptoms == 0
    return bench


@pytest.mark.parametrize(
    ("frame_id", "missing", "stops"),
    [
        (ELECTRICAL, ("ELECTRICAL_MISSING",), True),
        (COOLANT, ("COOLANT_MISSING", "COOLANT_RANGE", "COOLING_RANGE", "OUT_OF_DOMAIN"), True),
        (REQUEST, ("REQUEST_MISSING",), True),
        (VOLTAGES, ("ELECTRICAL_MISSING", "VOLTAGE_RANGE"), True),
        (TEMPERATURES, ("THERMAL_MISSING", "SURFACE_RANGE", "OUT_OF_DOMAIN"), True),
        (PLUG_IN, (), False),
    ],
)
def test_a_frame_with_a_wrong_checksum_is_seen_in_its_period_and_in_no_other(
    frame_id: int, missing: tuple[str, ...], stops: bool
) -> None:
    """It is not read; what has to come every period is missing as well, and stops the current."""
    bench = charging()
    command_A = bench.run(charge=True, change=corrupted(frame_id))
    assert bench.symptoms == bit("CORRUPTED_FRAMES", *missing)
    assert (command_A == 0.0) is stops
    bench.run(2, charge=True)
    assert bench.symptoms == 0
    assert bench.ecu.state.latched_faults == 0


@pytest.mark.parametrize("code", [2, 7, 15])
def test_a_request_that_is_none_stops_the_current_and_begins_none(code: int) -> None:
    bench = Bench()
    bench.run(20)
    for _ in range(2):
        assert bench.run(request=code) == 0.0
        assert bench.symptoms == bit("REQUEST_INVALID")
        assert bench.ecu.state.pack.state == lib.BMS_STANDBY
    bench = charging()
    assert bench.run(request=code) == 0.0
    assert bench.symptoms == bit("REQUEST_INVALID")
    assert bench.run(2, charge=True) < 0.0, "it has said neither off nor on"


@pytest.mark.parametrize(
    ("lost", "symptoms"),
    [
        (without(ELECTRICAL), ("ELECTRICAL_MISSING",)),
        (without(COOLANT), ("COOLANT_MISSING",)),
        (without(REQUEST), ("REQUEST_MISSING",)),
        (without(VOLTAGES, 1), ("ELECTRICAL_MISSING",)),
        (without(TEMPERATURES, 1), ("THERMAL_MISSING",)),
    ],
)
def test_at_start_up_every_message_and_page_is_waited_for_but_not_for_ever(
    lost: Change, symptoms: tuple[str, ...]
) -> None:
    bench = Bench()
    bench.run(START_UP_PERIODS, change=lost)
    assert not bench.ecu.state.has_started
    assert (bench.symptoms, bench.ecu.state.pack.state) == (0, lib.BMS_INIT)
    bench.run(change=lost)
    assert bench.ecu.state.has_started
    assert bench.symptoms & bit(*symptoms) == bit(*symptoms)
    bench = Bench()
    bench.run(START_UP_PERIODS // 2)
    assert bench.ecu.state.has_started, "where all of them come it is sooner"


def reprotected(frame: Frame, counter: int) -> Frame:
    """The frame as its sender would send it with another counter; the checksum is cantools'."""
    data = bytearray(frame.data)
    data[1] = (data[1] & 0xF0) | counter
    ids = data_ids(MESSAGES[frame.frame_id])
    data[0] = cantools.autosar.compute_profile2_crc(data, ids[counter])
    return frame._replace(data=bytes(data))


def bench_with_next_measurement() -> tuple[Bench, Frame]:
    """A bench that has run, and a frame that its ECU has not had yet."""
    bench = Bench()
    bench.run(20)
    bench.plant.measure()
    return bench, next(f for f in bench.wire.publish(False) if f.frame_id == ELECTRICAL)


@pytest.mark.parametrize(("frames", "counted"), [(1, 1), (254, 254), (255, 255), (300, 255)])
def test_measurements_in_one_period_are_counted_up_to_255_and_no_further(
    frames: int, counted: int
) -> None:
    """A count that wrapped around would make a lagging ECU look punctual."""
    bench, first = bench_with_next_measurement()
    counter = first.data[1] & 0x0F
    for step in range(frames):
        frame = reprotected(first, (counter + step) % 16)
        bench.ecu.receive(frame.frame_id, frame.data)
    bench.ecu._hand_on()
    assert bench.ecu.state.measured_periods == counted


@pytest.mark.parametrize(("step", "counted"), [(1, 1), (2, 2), (3, 3), (4, 1), (9, 1), (12, 1)])
def test_a_frame_counts_for_those_lost_before_it_but_not_of_a_sender_that_starts_anew(
    step: int, counted: int
) -> None:
    """A jump of more than may be lost is believed when the next frame goes on from there."""
    bench, first = bench_with_next_measurement()
    last = (first.data[1] & 0x0F) - 1  # that the ECU has had
    jumps = [step] if step <= 3 else [step, step + 1]
    for ahead in jumps:
        frame = reprotected(first, (last + ahead) % 16)
        bench.ecu.receive(frame.frame_id, frame.data)
    bench.ecu._hand_on()
    assert bench.ecu.state.measured_periods == counted


@pytest.mark.parametrize(
    ("group_id", "page", "cell"), [(VOLTAGES, 1, 4), (TEMPERATURES, 0, 6), (TEMPERATURES, 1, 2)]
)
def test_the_faulty_cell_is_the_first_of_the_first_page_that_is_missing(
    group_id: int, page: int, cell: int
) -> None:
    """That of the page's first thermistor, wherever it is; cells count from 1."""
    bench = Bench(6, thermistor_at=(5, 4, 3, 1, 0))
    bench.run()
    assert bench.heard.faulty_cell == 1, "no page is trusted yet"
    bench.run(60)
    assert bench.heard.faulty_cell == 0
    bench.run(change=without(group_id, page))
    assert bench.heard.faulty_cell == cell
    bench.run(2)
    assert bench.heard.faulty_cell == 0


def test_the_faulty_cell_is_1_for_a_reading_of_the_string_and_0_for_what_is_the_network_s() -> None:
    """Every cell has the symptom of a reading that all share, and the first one is named."""
    bench = charging()
    bench.plant.measure()
    bench.run(charge=True, change=without(COOLANT))
    assert bench.symptoms & bit("COOLANT_MISSING", "COOLANT_RANGE")
    assert bench.heard.faulty_cell == 1
    bench = charging()
    bench.run(charge=True, change=without(REQUEST))
    assert bench.symptoms == bit("REQUEST_MISSING")
    assert bench.heard.faulty_cell == 0


def test_a_pack_in_a_charge_that_waits_bleeds_no_cell_though_no_current_flows() -> None:
    """Near the top and with a gap, but a cell's core may be too hot for any current."""
    bench = charging(bleed_ohm=10.0, seed=1)
    state, k = bench.ecu.state, bench.ecu.state.pack.calibration.rcbf
    state.balance.least_soc, state.balance.least_gap = 0.0, 1e-6
    k.max_core_temperature_K.high_K = state.pack.cell[0].surface_temperature_K
    for _ in range(5):
        assert bench.run(charge=True) == 0.0
    assert state.pack.state in CHARGING and not state.pack.decision.decision.feasible
    assert bench.symptoms == 0 and abs(state.current_A) <= 0.1
    assert not any(state.bleeds[i] for i in range(4))
    bench.run(3)
    assert state.pack.state == lib.BMS_STANDBY
    assert any(state.bleeds[i] for i in range(4)), "with the request off it does"


def test_a_command_that_no_strongest_current_bounds_is_none_on_the_bus() -> None:
    """The calibration's, which memory may lose after it was found to be good."""
    bench = charging()
    calibration, pack = bench.ecu.state.pack.calibration, bench.ecu.state.pack
    calibration.reference_current_A = -1.0
    assert bench.run(charge=True) == pack.command_A == -1.0
    calibration.reference_current_A = math.nan
    assert bench.run(charge=True) == bench.heard.command_A == 0.0
    assert pack.command_A < 0.0, "of itself the core would have gone on"


def answers(ecu: Any) -> dict[str, float]:
    """All that an ECU says in a period, as cantools reads it."""
    frame, said = ffi.new("can_frame_t *"), {}
    while lib.pack_ecu_transmit(ecu, frame):
        message = MESSAGES[frame.id]
        data = bytes(frame.data)[: frame.length]
        said |= message.decode(data, decode_choices=False)
    assert not lib.pack_ecu_transmit(ecu, frame)
    return said


def ecu_of(config: Any) -> Any:
    ecu = ffi.new("pack_ecu_t *")
    lib.pack_ecu_init(ecu, config)
    return ecu


def balanced_config(calibration: Any) -> Any:
    pack = {"calibration": calibration, "cells": 0, "thermistors": 0}
    balance = {"resistor_ohm": 10.0, "least_soc": 0.5, "least_gap": 0.01}
    return ffi.new("pack_ecu_config_t *", {"pack": pack, "balance": balance})


@pytest.mark.parametrize("is_given", [False, True])
def test_an_ecu_without_a_pack_says_so_and_nothing_else(is_given: bool) -> None:
    """No configuration, and one of no cells: the fault at once, no page, no value, no current."""
    calibration = core_of("paper_calibrated").calibration
    ecu = ecu_of(balanced_config(calibration) if is_given else ffi.NULL)
    for _ in range(3):
        lib.pack_ecu_step(ecu)
        said = answers(ecu)
        assert said["CommandState"] == said["PackState"] == lib.BMS_FAULT
        assert said["CommandCurrent"] == pytest.approx(0.0, abs=1e-9)
        assert said["ActiveFaults"] == said["LatchedFaults"] == bit("CALIBRATION")
        assert said["FirstFault"] == lib.FAULT_CALIBRATION
        assert said["FaultyCell"] == said["WeakestCell"] == said["GoverningCell"] == 0
        assert said["AllowedCurrentNow"] == pytest.approx(0.0, abs=1e-9)
        assert said["AllowedCurrentFor10s"] == pytest.approx(0.0, abs=1e-9)
        assert not any(name.startswith("Cell0") for name in said)
    ecu = ecu_of(ffi.NULL)
    lib.pack_ecu_step(ecu)
    said = answers(ecu)
    assert (said["ModelHash"], said["PresetHash"], said["Cells"]) == (0, 0, 0)
    assert said["WeakestInDomain"] == 0
