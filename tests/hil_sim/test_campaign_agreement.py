"""A charge of the campaign's C runner is the charge that runs over the bus, bit by bit."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from hil_sim.studies.campaign.engine import SUB_STEPS, CampaignCharge, Scenario
from hil_sim.studies.campaign.noise import streams
from hil_sim.studies.campaign.real_draws import draw_real
from hil_sim.studies.campaign.settings import CampaignSettings

SEED = 5
BLOCK = 500
FULL_S = 3600.0


def noise(preset, kind):
    """The random numbers of run_both for SEED: first knot, then blocks of normals and knots."""
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    disturbance, sensors = (
        np.random.default_rng(child) for child in np.random.SeedSequence(SEED).spawn(2)
    )
    source = disturbance_source(kind, preset, step_s, disturbance)
    yield np.array(next(source), dtype=float)
    while True:
        knots = np.array(list(itertools.islice(source, BLOCK * SUB_STEPS)), dtype=float)
        yield sensors.standard_normal((BLOCK, 5)), knots


def charge_in_c(preset, controller, kind, max_time_s, true_cell=None):
    settings = CampaignSettings(
        preset, load_shipped_model(preset.name), runs=1, max_time_s=max_time_s
    )
    numbers = noise(preset, kind)
    charge = CampaignCharge(
        Scenario(settings),
        controller.value,
        true_cell or nominal_cell(preset),
        next(numbers),
    )
    trace = []
    for normals, knots in numbers:
        for i in range(BLOCK):
            state = charge.fields.memory.state
            trace.append((state.soc, state.core, state.surface, state.coolant))
            charge.advance(normals[i : i + 1], knots[i * SUB_STEPS : (i + 1) * SUB_STEPS])
            trace[-1] += (charge.fields.current_A,)
            if charge.is_over:
                return charge, trace


def over_the_bus(series):
    """State and current of each period."""
    states = (
        *(series.soc, series.core_temperature_K, series.surface_temperature_K),
        series.coolant_temperature_K,
    )
    return list(zip(*states, series.current_A))


def peaks_of(charge):
    peaks = charge.fields.peaks.cell
    temperatures_K = peaks.core_temperature_K, peaks.surface_temperature_K
    return (peaks.soc, *temperatures_K, peaks.voltage_V)


def peaks_of_bus(summary):
    temperatures_K = summary.max_core_temperature_K, summary.max_surface_temperature_K
    return (summary.max_soc, *temperatures_K, summary.max_voltage_V)


@pytest.mark.parametrize(
    ("name", "controller", "kind", "max_time_s"),
    [
        ("paper_calibrated", ControllerKind.KAN_RCBF, DisturbanceKind.BANG_BANG, FULL_S),
        ("paper_calibrated", ControllerKind.S_CBF, DisturbanceKind.UPWARD, FULL_S),
        ("paper_calibrated", ControllerKind.CC_CV, DisturbanceKind.UPWARD, FULL_S),
        ("lin2014", ControllerKind.KAN_RCBF, DisturbanceKind.UPWARD, FULL_S),
        ("lin2014", ControllerKind.KAN_RCBF, DisturbanceKind.GAUSSIAN, 100.0),
        ("lin2014", ControllerKind.S_CBF, DisturbanceKind.BANG_BANG, 100.0),
        ("lin2014", ControllerKind.CC_CV, DisturbanceKind.BANG_BANG, 100.0),
    ],
)
def test_every_period_is_that_of_the_run_over_the_bus(name, controller, kind, max_time_s):
    preset = load_preset(name)
    charge, trace = charge_in_c(preset, controller, kind, max_time_s)
    result = run_both(
        Settings(
            preset,
            controller=controller,
            seed=SEED,
            disturbance=kind,
            max_time_s=max_time_s,
        )
    )
    summary, series, fields = result.summary, result.series, charge.fields
    assert trace == over_the_bus(series)
    assert (charge.outcome, fields.periods) == (summary.stop_reason, summary.steps)
    assert peaks_of(charge) == peaks_of_bus(summary)
    assert fields.time_s == pytest.approx(series.time_s[-1])
    assert fields.first_derate_s == pytest.approx(summary.first_derate_s or -1.0)
    if controller is ControllerKind.KAN_RCBF:
        half_a_step_K = 0.0026
        assert fields.peaks.estimate_error_K == pytest.approx(
            summary.kan_max_abs_error_K, abs=half_a_step_K
        )
        assert fields.infeasible_periods == summary.infeasible_steps


REAL_PRESET = load_preset("a123_26650_10C")


@pytest.mark.parametrize("run", [0, 1, 2])
@pytest.mark.parametrize("controller", [ControllerKind.KAN_RCBF, ControllerKind.CC_CV])
def test_a_cell_of_the_family_charges_as_over_the_bus(run, controller):
    """With its tables, branches, wrong plug-in state, lag and tolerance of the charger, biases."""
    kind = DisturbanceKind.GAUSSIAN
    sensors = replace(
        REAL_PRESET.sensors, voltage_V=replace(REAL_PRESET.sensors.voltage_V, bias=0.002)
    )
    preset = replace(
        REAL_PRESET,
        sensors=sensors,
        uncertainty=replace(REAL_PRESET.uncertainty, core_K_per_As=1e-4),
    )
    true_cell = draw_real(preset, 10_800.0, streams(SEED, run).draw).cell
    charge, trace = charge_in_c(preset, controller, kind, 60.0, true_cell)
    settings = Settings(
        preset,
        controller=controller,
        seed=SEED,
        disturbance=kind,
        max_time_s=60.0,
        true_cell=true_cell,
    )
    result = run_both(settings)
    assert trace == over_the_bus(result.series)
    assert min(result.series.current_A) < -5.0
    assert charge.outcome == result.summary.stop_reason
    assert peaks_of(charge) == peaks_of_bus(result.summary)


def test_cc_cv_ends_by_its_tail_current_when_the_charger_told_too_little():
    """Told 0.5 of a cell that holds 0.985: counted charge would never get there."""
    preset = load_preset("lin2014")
    nominal = nominal_cell(preset)
    cell = replace(preset.cell, ocv=replace(preset.cell.ocv, overfill_slope_V=15.0))
    state = nominal.state._replace(soc=0.985)
    true_cell = replace(nominal, cell=cell, state=state, plug_in_soc=0.5)
    kind = DisturbanceKind.NONE
    charge, _ = charge_in_c(preset, ControllerKind.CC_CV, kind, 600.0, true_cell)
    settings = Settings(
        preset,
        ControllerKind.CC_CV,
        seed=SEED,
        disturbance=kind,
        max_time_s=600.0,
        true_cell=true_cell,
    )
    summary = run_both(settings).summary
    assert (charge.outcome, summary.stop_reason) == ("complete", "complete")
    assert charge.fields.periods == summary.steps
    assert 0.99 < summary.final_soc <= 1.005
