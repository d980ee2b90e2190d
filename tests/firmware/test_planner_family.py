"""Plans for a family, whose cell is known by intervals only, and for goals that change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bms.cell import CellFactors, scaled
from bms.presets import load_preset
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.result import RunResult
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from tests.firmware.bench import DATABASE, HEALTHY, Bench, StepwiseEcu, frame
from tests.firmware.planned_charge import time_s

PRESET = load_preset("a123_26650_10C")
HALF_FULL = replace(PRESET.initial, soc=0.5)
ASKED_S = 900.0
WRONGLY_PLUGGED_IN = (0.05, -0.05)
"""Told fuller than it is, with a charger that gives less: the count is full before the cell."""


def charge(
    mode: Mode | None,
    full_by_s: float | None = None,
    told: float = 0.0,
    supply: float = 0.0,
    initial: Initial = HALF_FULL,
    factors: CellFactors | None = None,
) -> RunResult:
    """The charger says `told` more than is there, and gives 1 + `supply` of what it is told."""
    cell = nominal_cell(PRESET, initial)
    cell = replace(
        cell,
        cell=scaled(cell.cell, factors or CellFactors()),
        plug_in_soc=cell.plug_in_soc + told,
        supply_tolerance=supply,
    )
    settings = Settings(
        PRESET,
        initial=initial,
        true_cell=cell,
        mode=mode,
        full_by_s=full_by_s,
        max_time_s=3000.0,
    )
    return run_both(settings)


@pytest.mark.parametrize(("told", "supply"), [(0.0, 0.0), WRONGLY_PLUGGED_IN])
def test_a_family_is_full_in_time_though_its_count_ends_early(told: float, supply: float) -> None:
    fastest_s = time_s(charge(None, None, told, supply))
    assert fastest_s < 0.5 * ASKED_S
    assert 0.8 * ASKED_S < time_s(charge(Mode.BY_TIME, ASKED_S, told, supply)) <= 1.01 * ASKED_S


def test_a_cold_cell_that_resists_more_is_full_in_time() -> None:
    """Its voltage limits it sooner than that of the family's own cell."""
    initial = replace(PRESET.initial, temperature_K=283.0)
    factors = CellFactors(resistance=1.6)
    asked_s = 1.1 * time_s(charge(None, initial=initial, factors=factors))
    in_time = charge(Mode.BY_TIME, asked_s, initial=initial, factors=factors)
    assert 0.9 * asked_s < time_s(in_time) <= 1.01 * asked_s


def test_the_fastest_charge_of_a_family_is_no_slower_than_the_fixed_one() -> None:
    fixed_s = time_s(charge(Mode.FIXED, None, *WRONGLY_PLUGGED_IN))
    assert time_s(charge(Mode.FASTEST, None, *WRONGLY_PLUGGED_IN)) <= fixed_s + 1.0


@pytest.mark.parametrize(("resistance", "start_K", "soc"), [(1.4, 280.0, 0.3), (1.6, 298.0, 0.5)])
def test_the_predicted_time_of_a_family_comes_true(
    resistance: float, start_K: float, soc: float
) -> None:
    """Within a fifth of the charge, for a cell of middle capacity."""
    initial = replace(PRESET.initial, temperature_K=start_K, soc=soc)
    cell = nominal_cell(PRESET, initial)
    factors = CellFactors(resistance=resistance, capacity=0.9)
    cell = replace(cell, cell=scaled(cell.cell, factors))
    result = run_both(Settings(PRESET, initial=initial, true_cell=cell, max_time_s=3000.0))
    end_s, series = time_s(result), result.series
    told = [
        abs(predicted - (end_s - time))
        for time, predicted in zip(series.time_s, series.predicted_time_to_full_s)
        if predicted is not None and time > 60.0
    ]
    assert len(told) > 100
    assert max(told) < 0.2 * end_s


class Pausing(StepwiseEcu):
    """Hears from second 60 to 64 that no charge is asked for, and remembers its plans."""

    def __init__(self) -> None:
        super().__init__(PRESET.name)
        self.planned_A: list[float] = []
        self.resistances_ohm: list[float] = []

    def receive(self, frame_id: int, data: bytes) -> None:
        request = DATABASE.get_message_by_name("ChargeRequest")
        if frame_id == request.frame_id and 600 <= len(self.planned_A) < 640:
            values = {**request.decode(data, decode_choices=False), "Request": 0}
            frame_id, data = frame(request.name, values["ChargeRequestCounter"], values)
        super().receive(frame_id, data)

    def step(self) -> None:
        super().step()
        self.planned_A.append(self._state.planner.planned_A)
        self.resistances_ohm.append(self._state.planner.start.resistance_ohm)


def test_after_a_pause_a_gentle_charge_is_planned_again_at_once() -> None:
    """Without current the heat of the last one says nothing of the resistance."""
    cell = nominal_cell(PRESET, replace(PRESET.initial, soc=0.3))
    ecus: list[Pausing] = []

    def factory(plant: object, database: object) -> Pausing:
        ecus.append(Pausing())
        return ecus[-1]

    settings = Settings(
        PRESET,
        initial=replace(PRESET.initial, soc=0.3),
        true_cell=cell,
        mode=Mode.BY_TIME,
        full_by_s=1200.0,
        max_time_s=120.0,
        ends_early=False,
    )
    commands_A = run_both(settings, ecu_factory=factory).series.command_A
    assert 0.0 in commands_A[620:640]
    assert max(ecus[0].resistances_ohm) < 0.1
    assert all(4.0 < planned < 8.0 for planned in ecus[0].planned_A[760:])
    assert min(commands_A[760:]) > -8.0


@pytest.mark.parametrize("later", [Mode.FASTEST, Mode.BY_TIME])
def test_another_goal_is_planned_without_waiting_for_the_search_of_the_last(later: Mode) -> None:
    bench = Bench(values={**HEALTHY, "Mode": float(Mode.BY_TIME), "TimeToFull": 64000.0})
    bench.start()
    for _ in range(300):
        bench.period()
    assert bench.command_A > -1.0
    bench.values |= {"Mode": float(later), "TimeToFull": 600.0}
    for _ in range(100):
        bench.period()
    assert bench.command_A < -5.0
