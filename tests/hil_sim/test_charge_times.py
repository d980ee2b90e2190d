"""The comparison of charges: the rivals, the errors of predictions, the bounds of drawn cells."""

from dataclasses import replace

import numpy as np
import pytest

from bms.cell import CellState
from bms.cell.integrator import integrate_step
from bms.errors import InputError
from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from hil_sim.studies.campaign.real_draws import draw_real
from hil_sim.studies.charge_times.comparison import Compared, certified_are_safe, summed_up
from hil_sim.studies.charge_times.controllers import PLANNED, Played, play
from hil_sim.studies.charge_times.family import at_rest, bounded_charge
from hil_sim.studies.charge_times.native import charge_in_c
from hil_sim.studies.charge_times.prediction import Asked, worst_error
from hil_sim.studies.charge_times.predictive import PredictiveController
from hil_sim.studies.charge_times.starts import Start, all_starts

SHORT = Start("lin2014", 298.0, 0.9, 1.0)


def played(**changes):
    made = Played(PLANNED, 110.0, "complete", 0.99, -1.0, -1.0, -0.1, -0.01, 322.0, 310.0, 900.0)
    return replace(made, **changes)


def compared(*charges):
    return Compared(SHORT, 100.0, 105.0, charges)


def test_there_are_24_starts_and_each_has_another_name():
    assert len({start.name for start in all_starts()}) == len(all_starts()) == 24


@pytest.mark.parametrize(("mode", "full_by_s"), [(Mode.FASTEST, None), (Mode.BY_TIME, 130.0)])
def test_a_mode_in_the_c_runner_charges_as_over_the_bus(mode, full_by_s):
    preset = SHORT.loaded()
    charge = charge_in_c(preset, "kan-rcbf", 600.0, mode=mode, full_by_s=full_by_s)
    summary = run_both(Settings(preset, mode=mode, full_by_s=full_by_s, max_time_s=600.0)).summary
    assert charge.outcome == summary.stop_reason == "complete"
    assert charge.fields.time_s == pytest.approx(summary.charge_time_s)
    assert charge.fields.memory.state.soc == summary.final_soc
    assert charge.fields.heat_J == pytest.approx(summary.heat_J, rel=1e-9)
    assert charge.mean_core_temperature_K == pytest.approx(summary.mean_core_temperature_K)


def test_the_heat_of_a_run_is_what_warmed_the_cell_and_left_with_the_coolant():
    """Balance of energy, by the heat capacities and the cooling alone."""
    preset = SHORT.loaded()
    result = run_both(Settings(preset, max_time_s=20.0))
    cell, series = preset.cell, result.series
    warmed_J = sum(
        capacity * (getattr(series, name)[-1] - getattr(series, name)[0])
        for capacity, name in (
            (cell.core_heat_capacity_J_per_K, "core_temperature_K"),
            (cell.surface_heat_capacity_J_per_K, "surface_temperature_K"),
            (cell.coolant_heat_capacity_J_per_K, "coolant_temperature_K"),
        )
    )
    duration_s = (len(series.time_s) - 1) * preset.timing.sampling_period_s
    cooled_J = preset.initial.cooling_power_W * duration_s
    assert result.summary.heat_J == pytest.approx(warmed_J + cooled_J, rel=0.01)
    assert result.summary.heat_J > 20.0


def test_the_predictive_rival_keeps_every_limit_and_is_faster_than_the_firmware():
    preset = SHORT.loaded()
    rival, firmware = (play(name, preset, 150.0) for name in (PredictiveController.name, PLANNED))
    assert not rival.crossed
    assert rival.charge_time_s < firmware.charge_time_s


def test_the_predictive_rival_wants_a_cell_of_constants():
    pytest.importorskip("cvxpy")
    with pytest.raises(InputError, match="constant parameters"):
        PredictiveController(load_preset("a123_26650_10C"))


def test_a_crossed_limit_or_an_unfilled_cell_of_a_certified_controller_fails():
    assert certified_are_safe([compared(played())])
    assert certified_are_safe([compared(played(core_over_K=0.0))])
    assert not certified_are_safe([compared(played(core_over_K=1e-9))])
    assert not certified_are_safe([compared(played(charge_time_s=None))])
    assert certified_are_safe([compared(played(controller="s-cbf", core_over_K=1.0))])


def test_an_unfilled_cell_is_worse_than_any_that_was_filled():
    rows = [compared(played()), compared(played(charge_time_s=None)), compared(played())]
    figures = summed_up(rows, PLANNED)
    assert figures["over_optimum_time_s"] == {"median": 1.1, "worst": None}
    assert (figures["full"], figures["charges"]) == (2, 3)


def test_an_error_of_a_prediction_counts_from_the_second_minute_and_beyond_the_signal_s_step():
    assert worst_error([(59.9, 500.0), (60.0, 41.0)], 100.0) == 0.0
    assert worst_error([(60.0, 43.0), (80.0, 20.0)], 100.0) == pytest.approx(2.0 / 40.0)
    assert worst_error([(10.0, 90.0)], 100.0) is None


@pytest.mark.parametrize(
    ("time_s", "core_K", "met"),
    [
        (100.99, 319.9, True),
        (99.01, 319.9, True),
        (101.01, 319.9, False),
        (98.99, 319.9, False),
        (100.0, 320.0, False),
        (None, 310.0, False),
    ],
)
def test_a_time_is_kept_to_one_per_cent_and_cooler_than_the_fastest(time_s, core_K, met):
    assert Asked(1.5, 100.0, time_s, core_K, 90.0, 320.0).is_met is met


def test_the_bound_of_a_drawn_cell_has_its_own_resistance_charger_and_start():
    preset = load_preset("a123_26650_10C")
    drawn = draw_real(preset, 10_800.0, np.random.default_rng(3)).cell
    cell = at_rest(preset, drawn)
    charge = bounded_charge(preset, cell)
    assert charge.cell is drawn.cell
    assert charge.strongest_A == pytest.approx(23.0 * (1.0 + drawn.supply_tolerance))
    assert (charge.start_soc, charge.start_K) == (drawn.state.soc, cell.state.core_temperature_K)
    assert len(set(cell.state[1:])) == 1
    rested = integrate_step(cell.cell, CellState(*cell.state), 0.0, 0.0, 1.0)
    assert rested.core_temperature_K == pytest.approx(cell.state.core_temperature_K)
