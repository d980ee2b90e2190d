"""The calibrated preset shows the paper's figures, and the fit that made it does what it says."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from bms.cell import CellState, integrate_step
from bms.errors import InputError
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset, preset_path
from bms.presets.paper_form import in_paper_form
from bms.studies.paper_fit import fit as fitting
from bms.studies.paper_fit.closed_loop import (
    HORIZON_S,
    Start,
    charge_with_robust_barriers,
    charge_with_surface_barrier,
)
from bms.studies.paper_fit.figures import FIGURES
from bms.studies.paper_fit.preset_text import with_values

CALIBRATED = load_preset("paper_calibrated")
ERROR_BOUND_K = load_shipped_model("paper_calibrated").error_bound_K


PAPERS = in_paper_form(CALIBRATED)


def start_of(preset):
    initial = preset.initial
    return Start(initial.soc, initial.temperature_K, initial.cooling_power_W)


@pytest.fixture(scope="module")
def charges():
    return fitting.both_charges(
        CALIBRATED,
        CALIBRATED.cell,
        start_of(CALIBRATED),
        ERROR_BOUND_K,
        fitting.FINAL_PERIOD_S,
    )


def test_the_figures_are_those_of_the_paper():
    assert {figure.name: figure.paper for figure in FIGURES} == {
        "KAN-rCBF core peak": 323.0,
        "KAN-rCBF surface peak": 319.06,
        "KAN-rCBF time to full": 784.54,
        "KAN-rCBF first derating": 171.60,
        "S-CBF core peak": 327.97,
        "S-CBF surface peak": 323.11,
        "S-CBF time to full": 712.96,
    }
    for figure in FIGURES:
        expected = 0.5 if figure.unit == "K" else pytest.approx(0.02 * figure.paper)
        assert figure.tolerance == expected


def test_the_calibrated_preset_shows_peaks_within_half_a_kelvin_and_times_within_two_percent(
    charges,
):
    for figure, ours in zip(FIGURES, fitting.figures_of(*charges)):
        assert abs(ours - figure.paper) <= figure.tolerance, figure.name


def test_the_calibrated_charge_keeps_its_limits_and_never_pauses(charges):
    robust, _ = charges
    assert robust.core_peak_K < CALIBRATED.limits.max_core_temperature_K
    assert robust.surface_peak_K < CALIBRATED.limits.max_surface_temperature_K
    assert robust.regrowth_A < 1.0


def test_the_calibrated_core_time_constant_is_the_papers():
    cell = CALIBRATED.cell
    product_s = cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K
    assert 1.0 / product_s == pytest.approx(0.0246, rel=1e-4)


@pytest.mark.parametrize("parameter", fitting.FREE_PARAMETERS, ids=lambda p: p.name)
def test_every_fitted_value_lies_in_its_physical_range(parameter):
    holder = CALIBRATED.initial if parameter.name in Start._fields else CALIBRATED.cell
    value = getattr(holder, parameter.name)
    rounding = 1e-4 * max(abs(parameter.low), abs(parameter.high))
    assert parameter.low - rounding <= value <= parameter.high + rounding


def test_both_charges_stay_inside_the_operating_box_with_two_kelvin_to_spare():
    """Measured on the way by a plain loop at full current, which is hotter than either policy."""
    box, start = CALIBRATED.operating_box, start_of(CALIBRATED)
    state = CellState(start.soc, *[start.temperature_K] * 3)
    low_K = high_K = np.full(2, start.temperature_K)
    while state.surface_temperature_K < CALIBRATED.limits.max_surface_temperature_K:
        state = integrate_step(
            CALIBRATED.cell,
            state,
            CALIBRATED.limits.reference_current_A,
            start.cooling_power_W,
            0.5,
        )
        seen = np.array([state.surface_temperature_K, state.coolant_temperature_K])
        low_K, high_K = np.minimum(low_K, seen), np.maximum(high_K, seen)
    ranges = np.array([box.surface_temperature_K, box.coolant_temperature_K])
    assert np.all(ranges[:, 0] <= low_K - 2.0)
    assert np.all(high_K + 2.0 <= ranges[:, 1])
    assert box.cooling_power_W[0] <= start.cooling_power_W <= box.cooling_power_W[1]


def test_many_candidates_at_once_give_what_each_gives_alone():
    """Cells of both presets side by side, in one call and one by one."""
    names = [
        parameter.name
        for parameter in fitting.FREE_PARAMETERS
        if parameter.name not in Start._fields
    ]
    cells = [CALIBRATED.cell, load_preset("lin2014").cell]
    stacked = {name: np.array([getattr(cell, name) for cell in cells]) for name in names}
    capacities = np.array([cell.core_heat_capacity_J_per_K for cell in cells])
    base, start = CALIBRATED.cell, Start(0.3, 300.0, 0.5)
    together = fitting.both_charges(
        CALIBRATED,
        replace(base, **stacked, core_heat_capacity_J_per_K=capacities),
        Start(*(np.full(2, value) for value in start)),
        0.5,
        1.0,
    )
    for index, cell in enumerate(cells):
        alone = fitting.both_charges(
            CALIBRATED, replace(cell, capacity_Ah=base.capacity_Ah, ocv=base.ocv), start, 0.5, 1.0
        )
        for many, one in zip(together, alone):
            assert [figure[index] for figure in many] == pytest.approx(
                [float(figure) for figure in one], rel=1e-9
            )


def test_a_charge_that_is_not_full_in_time_is_reported_as_later_than_the_horizon():
    hot = Start(0.0, CALIBRATED.limits.max_surface_temperature_K, 0.0)
    for charge in (
        charge_with_robust_barriers(CALIBRATED.cell, PAPERS, hot, 0.5, 1.0),
        charge_with_surface_barrier(CALIBRATED.cell, PAPERS, hot, 1.0),
    ):
        assert charge.time_s > HORIZON_S


@pytest.fixture
def quick(monkeypatch):
    """A coarse and short search."""
    for name, value in {
        "SEARCH_PERIOD_S": 1.0,
        "POLISH_PERIOD_S": 1.0,
        "POLISH_EVALUATIONS": 2,
    }.items():
        monkeypatch.setattr(fitting, name, value)


def test_a_fit_reports_progress_and_stays_in_the_ranges(quick):
    seen = []
    values = fitting.fit(CALIBRATED, 0.5, 3, 2, lambda *report: seen.append(report))
    assert [generation for generation, _ in seen] == [1, 2]
    assert seen[1][1] <= seen[0][1]
    for parameter, value in zip(fitting.FREE_PARAMETERS, values):
        assert parameter.low <= value <= parameter.high


def test_a_rounded_fit_keeps_the_core_time_constant_and_five_digits():
    exact = [1.23456789, 5.0, 1.1, 20.0, 0.0123456789, -1.23456789e-5, 281.123456, 0.00004, 0.2]
    fitted = fitting.rounded_preset(CALIBRATED, np.array(exact))
    assert fitted.cell.core_resistance_K_per_W == 1.2346
    assert fitted.cell.ohmic_resistance_ohm == 0.012346
    assert fitted.cell.entropic_coefficient_V_per_K == -1.2346e-5
    assert (fitted.initial.temperature_K, fitted.initial.soc) == (281.12, 0.0)
    product_s = fitted.cell.core_resistance_K_per_W * fitted.cell.core_heat_capacity_J_per_K
    assert 1.0 / product_s == pytest.approx(0.0246, rel=1e-5)
    assert fitted.limits == CALIBRATED.limits


def test_values_are_replaced_in_their_section_and_nothing_else_changes(tmp_path):
    text = preset_path("paper_calibrated").read_text()
    changed = with_values(text, {("initial", "soc"): 0.25, ("cell", "capacity_Ah"): 2.5})
    path = tmp_path / "changed.toml"
    path.write_text(changed)
    fitted = load_preset(path)
    assert fitted.initial == replace(CALIBRATED.initial, soc=0.25)
    assert fitted.cell == replace(CALIBRATED.cell, capacity_Ah=2.5)
    assert len(set(text.splitlines()) - set(changed.splitlines())) == 2
    with pytest.raises(InputError, match=r"no line 'soc = ...' in \[limits\]"):
        with_values(text, {("limits", "soc"): 0.5})


def paper_fit(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "bms.studies.paper_fit", *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={"COLUMNS": "120", "OPENBLAS_NUM_THREADS": "1"},
    )


def test_the_command_compares_every_figure_without_a_search():
    done = paper_fit("--generations", "0")
    assert done.returncode == 0
    for figure in FIGURES:
        (line,) = (line for line in done.stdout.splitlines() if figure.name in line)
        paper, ours, difference, _ = line.split()[-4:]
        assert float(paper) == figure.paper
        assert float(ours) - figure.paper == pytest.approx(float(difference), abs=0.011)


def test_the_command_refuses_an_unknown_preset_in_one_line():
    done = paper_fit("--preset", "unheard-of", "--generations", "0")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "unheard-of" in done.stderr


def test_the_command_names_a_file_that_cannot_be_written_in_one_line(tmp_path):
    target = tmp_path / "absent" / "fitted.toml"
    done = paper_fit("--generations", "0", "--out", str(target))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert str(target) in done.stderr
