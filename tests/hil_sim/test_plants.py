"""Whatever has the attributes of a plant is charged; plants are found by their names."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from bms.cell import Disturbance, ResistanceTable
from bms.errors import InputError
from bms.presets import load_preset
from hil_sim.plant import catalog
from hil_sim.plant.catalog import make_plant
from hil_sim.plant.heated_masses import HeatedMasses
from hil_sim.plant.plant import Extremes, Plant
from hil_sim.plant.recorded_plant import RecordedPlant, recorded_resistance
from tests.hil_sim.plants import calm, held, started, stored_heat_J

HEADER = "time_s,current_A,voltage_V\n"


@pytest.fixture(scope="module")
def preset():
    return load_preset("lin2014")


def recording(path, preset, current_A, resistance, start_soc=0.2, error_V=0.0):
    """A CSV file: a second of rest, then the current (A) of every second, resistance over SoC."""
    soc, rows = start_soc, []
    for time_s, current in enumerate([0.0, *current_A]):
        voltage_V = float(preset.cell.ocv(soc)) - current * resistance(soc) + error_V * (time_s > 0)
        rows.append(f"{time_s},{current},{voltage_V:.9f}\n")
        soc -= current / preset.cell.capacity_As
    path.write_text(HEADER + "".join(rows), encoding="utf-8")
    return path


def test_the_default_is_the_two_mass_plant(preset):
    assert type(make_plant(catalog.DEFAULT_PLANT, preset, calm())) is Plant


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("one-mass", "no plant 'one-mass'; take one of two-mass, pybamm, recorded"),
        ("", "no plant ''"),
        ("two-mass:3", "takes nothing after its name"),
        ("recorded", "give a CSV file with the columns time_s, current_A, voltage_V"),
        ("recorded:a.csv,soc=1.1", "'soc=1.1' must be a number from 0 to 1"),
        ("recorded:a.csv,soc=nan", "'soc=nan' must be a number"),
        ("recorded:a.csv,soc", "'soc' must be a number"),
        ("recorded:a.csv,soc=0.1,soc=0.2", "gives soc again; give it once"),
        ("recorded:a.csv,contact=1", "is no option of this plant; it has soc=NUMBER"),
        ("recorded:absent.csv", "absent.csv"),
    ],
)
def test_a_name_that_means_nothing_is_refused_in_one_line(preset, spec, said):
    with pytest.raises(InputError) as refused:
        make_plant(spec, preset, calm())
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_registered_plant_that_cannot_be_loaded_is_named(preset, monkeypatch):
    broken = EntryPoint("broken", "no_such_module:make", catalog.ENTRY_POINTS)
    monkeypatch.setattr(catalog, "entry_points", lambda group: [broken])
    with pytest.raises(InputError, match=r"'no_such_module:make' cannot be loaded .*reinstall"):
        make_plant("broken", preset, calm())


def test_the_command_refuses_an_unknown_plant(bms):
    code, printed, error = bms("sil", "--plant", "one-mass", "--max-time-s", 1)
    assert (code, printed, error.count("\n")) == (2, "", 1)


def test_all_heat_that_goes_in_is_in_core_surface_and_coolant_or_taken_away(preset):
    masses, peaks = HeatedMasses(preset, calm()), Extremes(0.0, 0.0, 0.0, 0.0)
    for _ in range(1000):
        masses.advance(5.0, 0.5, 2.0, peaks)
    assert stored_heat_J(preset, masses) == pytest.approx(100 * (5.0 - 2.0), abs=1e-6)
    assert masses.state.soc == 0.5
    assert peaks.core_temperature_K == pytest.approx(masses.state.core_temperature_K)
    assert peaks.core_temperature_K > peaks.surface_temperature_K > 298.15


def test_the_disturbance_warms_the_masses_as_it_warms_the_two_mass_plant(preset):
    knots = np.random.default_rng(1).uniform(-1e-2, 1e-2, (1001, 3))
    source = [Disturbance(0.0, *row) for row in knots.tolist()]
    masses, plant = HeatedMasses(preset, iter(source)), Plant(preset, iter(source))
    for _ in range(100):
        masses.advance(0.0, preset.initial.soc, plant.cooling_power_W, plant.extremes)
        plant.advance()
    # Of one a Runge-Kutta step, of the other the exact one: tests/hil_sim/test_campaign_cell.py.
    assert np.abs(np.subtract(masses.state, plant.state)).max() < 2e-9


def test_with_the_resistance_of_the_preset_a_recorded_plant_is_the_two_mass_plant(preset):
    constant = ResistanceTable((298.0,), (0.5,), ((preset.cell.ohmic_resistance_ohm,),))
    recorded, plant = RecordedPlant(preset, calm(), constant), Plant(preset, calm())
    for current_A in (-23.0, -10.0, 0.0, -23.0):
        held(recorded, current_A, 300)
        held(plant, current_A, 300)
    # Reversible heat is held over a period here and follows the core in the other.
    assert np.abs(np.array(recorded.state) - np.array(plant.state)).max() < 1e-5
    assert recorded.voltage_V == pytest.approx(plant.voltage_V, abs=1e-9)
    assert recorded.extremes.voltage_V == pytest.approx(plant.extremes.voltage_V, abs=1e-9)
    assert recorded.extremes.soc == pytest.approx(plant.extremes.soc, abs=1e-12)


def test_the_resistance_of_a_recording_is_found_over_state_of_charge(preset, tmp_path):
    def true_ohm(soc):
        return 0.02 - 0.01 * soc

    path = recording(tmp_path / "charge.csv", preset, [-10.0] * 500, true_ohm)
    table = recorded_resistance(path, preset)
    assert table.soc[0] < 0.25 and table.soc[-1] > 0.75
    found = np.array(table.ohm[0][1:-1])
    assert np.abs(found - true_ohm(np.array(table.soc[1:-1]))).max() < 2e-5


def test_an_error_of_the_open_circuit_voltage_cancels_between_charge_and_discharge(
    preset, tmp_path
):
    drive = [-10.0, 10.0] * 300
    path = recording(tmp_path / "drive.csv", preset, drive, lambda soc: 0.015, 0.5, error_V=0.02)
    assert recorded_resistance(path, preset, 0.5).ohm[0] == pytest.approx((0.015,), abs=1e-5)
    one_way = recording(
        tmp_path / "charge.csv", preset, [-10.0] * 300, lambda soc: 0.015, 0.5, error_V=0.02
    )
    assert min(recorded_resistance(one_way, preset, 0.5).ohm[0]) > 0.0165, "it does not there"


def test_replayed_with_its_own_current_it_gives_off_the_heat_of_the_recording(preset, tmp_path):
    current_A = [-20.0] * 60 + [-5.0] * 60 + [10.0] * 30 + [-15.0] * 60

    def true_ohm(soc):
        return 0.02 - 0.01 * soc

    path = recording(tmp_path / "mixed.csv", preset, current_A, true_ohm)
    without_entropy = replace(
        started(preset, 0.2), cell=replace(preset.cell, entropic_coefficient_V_per_K=0.0)
    )
    plant = RecordedPlant(without_entropy, calm(), recorded_resistance(path, preset))
    plant.cooling_power_W = 0.0
    for current in current_A:
        held(plant, current, 10)
    soc = 0.2 - np.cumsum([0.0, *current_A])[:-1] / preset.cell.capacity_As
    recorded_J = float(np.sum(np.square(current_A) * true_ohm(soc)))
    assert stored_heat_J(without_entropy, plant) == pytest.approx(recorded_J, rel=0.01)
    nominal_J = float(np.sum(np.square(current_A))) * preset.cell.ohmic_resistance_ohm
    assert recorded_J > 1.3 * nominal_J, "the preset's own resistance would not pass"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[1:], r"begins with -10 A.*add ',soc='"),
        (lambda rows: rows[:4], r"fewer than 5 rows"),
        (lambda rows: [row.replace("-10.0", "0.0") for row in rows], r"no current flows"),
        (lambda rows: [*rows, rows[-1]], r"time_s must rise"),
    ],
)
def test_a_recording_that_does_not_tell_a_resistance_is_refused(preset, tmp_path, change, said):
    path = recording(tmp_path / "charge.csv", preset, [-10.0] * 100, lambda soc: 0.015)
    rows = path.read_text().splitlines(keepends=True)[1:]
    assert recorded_resistance(path, preset).ohm
    path.write_text(HEADER + "".join(change(rows)))
    with pytest.raises(InputError, match=said) as refused:
        recorded_resistance(path, preset)
    assert str(path) in str(refused.value)


def test_a_start_at_which_the_voltage_contradicts_the_cell_is_refused(preset, tmp_path):
    path = recording(tmp_path / "charge.csv", preset, [-10.0] * 50, lambda soc: 0.005)
    assert recorded_resistance(path, preset, 0.2).ohm
    with pytest.raises(InputError, match=r"-\S+ mohm at state of charge .* give the start with"):
        recorded_resistance(path, preset, 0.9)


def test_a_recording_that_begins_under_load_is_taken_with_its_state_of_charge(preset, tmp_path):
    path = recording(tmp_path / "charge.csv", preset, [-10.0] * 100, lambda soc: 0.015)
    header, _, *rows = path.read_text().splitlines(keepends=True)
    path.write_text(header + "".join(rows))
    table = recorded_resistance(path, preset, 0.2)
    assert table.ohm[0] == pytest.approx([0.015] * len(table.soc), abs=1e-6)


def test_a_charge_of_a_recorded_cell_is_reported_with_its_name(preset, tmp_path, bms):
    path = recording(tmp_path / "charge.csv", preset, [-10.0] * 500, lambda soc: 0.009)
    spec = f"recorded:{path}"
    code, printed, error = bms(
        "sil", "--preset", "lin2014", "--plant", spec, "--max-time-s", 20, "--json"
    )
    assert code == 1
    assert "time ended before the charge" in error
    summary = json.loads(printed)
    assert (summary["plant"], summary["min_anode_potential_V"]) == (spec, None)
    # 2.4 mohm less than the preset at 23 A.
    _, printed, _ = bms("sil", "--preset", "lin2014", "--max-time-s", 20, "--json")
    fall_V = json.loads(printed)["max_voltage_V"] - summary["max_voltage_V"]
    assert fall_V == pytest.approx(23 * 2.4e-3, abs=1e-3)
