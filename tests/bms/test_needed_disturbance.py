"""The disturbance that a recording needs: known ones are recovered, bounds cover what they say."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from bms.cell import CellState, Disturbance, integrate_step, terminal_voltage_V
from bms.data.measurements import COLUMNS, Measurements, read_measurements, read_voltage
from bms.errors import InputError
from bms.identification.disturbance import missing_rates
from bms.identification.disturbance_bound import SHARE, STRETCHES, Growth, disturbance_bound
from bms.identification.heat import THERMAL, assumed_heat_W, fitted_to_heat, measured_heat_W
from bms.identification.needed import (
    ASSUMED,
    COOLANT,
    MEASURED,
    REFITTED,
    SURFACE,
    needed_uncertainty,
    stated,
)
from bms.presets import load_preset
from tests.bms.kan_samples import write_recording

MEASURED_CYCLE = Path(__file__).parents[3] / "shared" / "data" / "a123_26650_hev_cycle_1.csv"
with_measured_cycle = pytest.mark.skipif(
    not MEASURED_CYCLE.is_file(), reason="not run: no measured data in ../shared/data"
)
SINGLE, FAMILY = load_preset("lin2014"), load_preset("a123_26650")
CELL = SINGLE.cell
PERIOD_S = 1.0
SUBSTEPS = 2
NONE = np.zeros(1200)


def recorded(cell=CELL, core=NONE, surface=NONE, coolant=NONE, cooling_W=0.05, noise_K=0.0):
    """Recording and voltage of a cell under rests and pulses, with disturbances in K/s a row."""
    rng = np.random.default_rng(3)
    rows = len(core)
    current_A = np.repeat(rng.uniform(-25.0, 20.0, rows // 20 + 1), 20)[:rows]
    current_A[:20] = 0.0
    state, states = CellState(0.5, 295.0, 295.0, 295.0), []
    for current, *rates in zip(current_A, core, surface, coolant):
        states.append(state)
        disturbance = Disturbance(0.0, *rates)
        for _ in range(SUBSTEPS):
            state = integrate_step(
                cell, state, current, cooling_W, PERIOD_S / SUBSTEPS, disturbance, disturbance
            )
    soc, core_K, surface_K, coolant_K = np.array(states).T
    recording = Measurements(
        time_s=PERIOD_S * np.arange(rows),
        current_A=current_A,
        cooling_power_W=np.full(rows, cooling_W),
        surface_temperature_K=surface_K + noise_K * rng.standard_normal(rows),
        coolant_temperature_K=coolant_K,
        core_temperature_K=core_K + noise_K * rng.standard_normal(rows),
    )
    return recording, terminal_voltage_V(cell, soc, current_A, core_K)


def wave(size_K_per_s, period_s):
    return size_K_per_s * np.sin(2.0 * np.pi * np.arange(1200) / period_s)


def test_known_disturbances_of_core_surface_and_coolant_are_recovered():
    truth = {
        "core": wave(0.01, 200.0),
        "surface": wave(0.02, 300.0) + 0.01,
        "coolant": wave(0.005, 400.0),
    }
    recording, _ = recorded(**truth, noise_K=0.005)

    rates = missing_rates(CELL, recording, assumed_heat_W(CELL, recording), 0.008)

    for part, rate_K_per_s in truth.items():
        found = getattr(rates, part)
        error = found.rate_K_per_s - rate_K_per_s
        assert np.sqrt(np.mean(error[10:-10] ** 2)) < 0.1 * np.max(np.abs(rate_K_per_s))
        assert found.error_rms_K <= 0.008


def test_model_without_a_gap_needs_next_to_nothing():
    recording, _ = recorded()

    rates = missing_rates(CELL, recording, assumed_heat_W(CELL, recording), 0.01)

    assert np.max(np.abs(rates.core.rate_K_per_s)) < 2e-4
    assert np.max(np.abs(rates.surface.rate_K_per_s)) < 2e-3


def test_the_closer_the_model_follows_the_larger_the_disturbance_and_the_shorter_its_time_scale():
    recording, _ = recorded(core=wave(0.02, 60.0))
    heat_W = assumed_heat_W(CELL, recording)

    close, loose = (missing_rates(CELL, recording, heat_W, at).core for at in (0.01, 0.1))

    assert np.max(np.abs(close.rate_K_per_s)) > 1.2 * np.max(np.abs(loose.rate_K_per_s))
    assert close.time_scale_s < loose.time_scale_s
    assert close.error_rms_K == pytest.approx(0.01, rel=0.02)
    assert loose.error_rms_K == pytest.approx(0.1, rel=0.02)


def test_bound_that_the_rates_reach_at_each_current_is_found():
    current_A = np.linspace(-30.0, 20.0, 2000)
    truth = Growth(1e-3, 2e-4, 3e-6)
    signs = np.where(np.arange(2000) % 3, 1.0, -1.0)

    fitted = disturbance_bound(signs * truth(current_A), current_A, grows=True).fitted

    assert dataclasses.astuple(fitted) == pytest.approx(dataclasses.astuple(truth), rel=1e-3)


@pytest.mark.parametrize("grows", [True, False])
def test_bound_covers_the_share_and_no_smaller_one_would(grows):
    rng = np.random.default_rng(1)
    current_A = rng.uniform(-25.0, 25.0, 4990)
    rates = rng.standard_normal(4990) * (1e-3 + 1e-4 * np.abs(current_A))

    bound = disturbance_bound(rates, current_A, grows=grows)

    covered = np.mean(np.abs(rates) <= bound.fitted(current_A) * (1.0 + 1e-9))
    assert SHARE <= covered <= SHARE + 3 / 4990
    assert np.mean(np.abs(rates) <= 0.99 * bound.fitted(current_A)) < SHARE
    assert bound.quantiles_K_per_s[-1] == np.quantile(np.abs(rates), SHARE)
    assert (bound.fitted.per_A_K_per_As > 0.0) == grows


def test_stretch_with_twice_the_disturbance_is_not_covered_by_the_others_until_doubled():
    current_A = np.full(1900, -10.0)
    rates = np.full(1900, 1e-3)
    rates[500:600] = 2e-3

    bound = disturbance_bound(rates, current_A, grows=False)
    of_others = disturbance_bound(np.delete(rates, slice(500, 600)), current_A[100:], grows=False)

    assert bound.coverage == (1.0,) * 5 + (0.0,) + (1.0,) * 13
    assert bound.factor == pytest.approx(2.0)
    assert bound.conformal.constant_K_per_s == pytest.approx(2.0 * bound.fitted.constant_K_per_s)
    assert bound.confidence == 0.95
    assert of_others.factor == 1.0


@pytest.mark.parametrize("rows", [STRETCHES - 1, STRETCHES])
def test_a_bound_takes_a_row_in_each_stretch(rows):
    if rows < STRETCHES:
        with pytest.raises(InputError, match="18 rows"):
            disturbance_bound(np.ones(rows), np.ones(rows), grows=False)
    else:
        assert disturbance_bound(np.ones(rows), np.ones(rows), grows=False).factor == 1.0


def test_voltage_tells_the_heat_of_an_aged_cell():
    """The cell has 1.5 times the resistance that the model assumes; its voltage shows it."""
    aged = dataclasses.replace(CELL, ohmic_resistance_ohm=1.5 * CELL.ohmic_resistance_ohm)
    recording, voltage_V = recorded(aged)

    measured_W = measured_heat_W(CELL, recording, voltage_V)
    true_W = assumed_heat_W(aged, recording)
    # The mean of two rows' voltages is not the held one's where the current jumps.
    steady = np.diff(recording.current_A) == 0.0
    np.testing.assert_allclose(measured_W[steady], true_W[steady], atol=2e-3)

    needed = needed_uncertainty(CELL, recording, voltage_V, 0.05).disturbances
    assumed, measured = (needed[name].bound.quantiles_K_per_s for name in (ASSUMED, MEASURED))
    assert measured[0] < 0.2 * assumed[0]
    assert measured[-1] < 0.5 * assumed[-1]


def test_known_heat_gives_the_heat_capacity_that_temperatures_alone_do_not():
    wider = dataclasses.replace(CELL, core_heat_capacity_J_per_K=75.0, core_resistance_K_per_W=2.4)
    recording, _ = recorded(wider)

    found = fitted_to_heat(CELL, recording, assumed_heat_W(wider, recording))

    for name in THERMAL:
        assert getattr(found, name) == pytest.approx(getattr(wider, name), rel=0.01)


def test_what_the_data_do_not_tell_is_said_and_the_preset_keeps_it():
    recording, voltage_V = recorded(cooling_W=0.0)
    flowing = Measurements(
        **{
            field.name: getattr(recording, field.name)[40:]
            for field in dataclasses.fields(recording)
        }
    )

    silent = needed_uncertainty(CELL, recording, None)
    started = needed_uncertainty(CELL, flowing, voltage_V[40:])

    assert "voltage_V" in silent.untold[MEASURED]
    assert "begin the recording at rest" in started.untold[MEASURED]
    assert "cooling_power_W is 0" in silent.untold[COOLANT]
    assert set(silent.disturbances) == {ASSUMED, SURFACE}
    start = SINGLE.uncertainty
    assert stated(start, silent, is_family=True).coolant_K_per_s == start.coolant_K_per_s


def test_preset_states_the_conformal_bound_rounded_up():
    recording, voltage_V = recorded(core=wave(0.01, 150.0), noise_K=0.005)
    needed = needed_uncertainty(CELL, recording, voltage_V, 0.02)

    for is_family, source in ((False, ASSUMED), (True, MEASURED)):
        written = stated(SINGLE.uncertainty, needed, is_family=is_family)
        bound = needed.disturbances[source].bound.conformal
        for value, exact in (
            (written.core_K_per_s, bound.constant_K_per_s),
            (written.core_K_per_As, bound.per_A_K_per_As),
            (written.core_K_per_A2s, bound.per_A2_K_per_A2s),
            (
                written.coolant_K_per_s,
                needed.disturbances[COOLANT].bound.conformal.constant_K_per_s,
            ),
        ):
            assert exact <= value <= 1.01 * exact
        assert written.surface_rate_K_per_s2 == SINGLE.uncertainty.surface_rate_K_per_s2


@pytest.mark.slow
def test_command_writes_the_bound_that_it_prints(bms, tmp_path):
    recording, voltage_V = recorded(core=wave(0.01, 150.0), noise_K=0.005)
    columns = {name: getattr(recording, name) for name in COLUMNS} | {"voltage_V": voltage_V}
    path = write_recording(tmp_path / "run.csv", rows=1200, **columns)

    arguments = ("identify", "--data", path, "--out", tmp_path / "mine.toml")
    code, out, _ = bms(*arguments, "--accuracy", "0.02", "--json")

    told, preset = json.loads(out)["disturbance"], load_preset(tmp_path / "mine.toml")
    assert code == 0
    assert told["accuracy_K"] == 0.02
    assert set(told["needed"]) == {ASSUMED, MEASURED, REFITTED, SURFACE, COOLANT}
    core = told["needed"][ASSUMED]["conformal"]
    assert preset.uncertainty.core_K_per_s == pytest.approx(core["constant_K_per_s"], rel=0.01)
    assert preset.uncertainty.core_K_per_s > 5e-3
    assert any(ASSUMED in source and "0.02 K" in source for source in preset.sources)

    code, out, _ = bms(*arguments)
    text = " ".join(out.split())
    assert code == 0
    assert "99.9 % below" in text
    assert f"a preset states n0, n1, n2 of '{ASSUMED}'" in text


@pytest.mark.parametrize(
    ("first", "expected"), [("3.3", [3.3, 3.31]), ("", None), ("nan", None), (None, None)]
)
def test_voltage_with_a_gap_is_none(tmp_path, first, expected):
    lines = ["time_s, voltage_V", f"0,{first}", "1,3.31"]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines if first is not None else ["time_s", "0", "1"]), "utf-8")

    found = read_voltage(path)

    assert (None if found is None else found.tolist()) == expected


@pytest.mark.slow
@with_measured_cycle
def test_measured_drive_cycle_needs_what_the_design_says():
    """Median 3e-3 to 6e-3 K/s and 6e-2 at 99.9 %, with the model of all rows, of constant R0."""
    recording, voltage_V = read_measurements(MEASURED_CYCLE), read_voltage(MEASURED_CYCLE)
    cell = dataclasses.replace(
        FAMILY.cell,
        core_resistance_K_per_W=2.66386,
        surface_resistance_K_per_W=4.29762,
        ohmic_resistance_ohm=0.0159424,
        entropic_coefficient_V_per_K=-0.000569249,
    )

    needed = needed_uncertainty(cell, recording, voltage_V).disturbances
    assumed, measured, refitted = (
        needed[name].bound.quantiles_K_per_s for name in (ASSUMED, MEASURED, REFITTED)
    )
    closer = missing_rates(cell, recording, assumed_heat_W(cell, recording), 0.075).core

    assert 3e-3 < assumed[0] < 6e-3
    assert np.quantile(np.abs(closer.rate_K_per_s), SHARE) == pytest.approx(6e-2, rel=0.1)
    assert refitted[0] < 0.4 * assumed[0]
    assert all(less < more for less, more in zip(measured, assumed))
    assert all(less < more for less, more in zip(refitted, measured))
