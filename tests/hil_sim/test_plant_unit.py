"""The plant as a unit: the cell of the bus in steps of any length, with parameters that change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bms.errors import PlantError
from bms.presets import Preset, load_preset
from hil_sim.fmu.plant_variables import plant_variables
from hil_sim.fmu.unit import Unit
from hil_sim.plant.plant import Plant
from hil_sim.plant.true_cell import nominal_cell
from tests.hil_sim.plants import calm
from tests.hil_sim.units import PRESET, exported_plant, written

TABLED = "samsung_30q"
"""A cell with branches and a table of its resistance."""
OUTPUTS = (
    *("voltage_V", "soc", "core_temperature_K", "surface_temperature_K"),
    *("coolant_temperature_K", "cooling_power_W"),
)
THERMAL = (
    *("core_resistance_K_per_W", "core_heat_capacity_J_per_K", "surface_resistance_K_per_W"),
    *("surface_heat_capacity_J_per_K", "coolant_heat_capacity_J_per_K"),
)


class Cell:
    """A running plant unit, its variables by their names."""

    def __init__(self, folder, version=3, preset=PRESET, **parameters) -> None:
        self.unit = Unit(written(folder, exported_plant(version, preset)), "unit")
        self.unit.instantiate()
        self.unit.enter_initialization()
        self.set(**parameters)
        self.unit.initialize()

    def set(self, **values) -> None:
        self.unit.set(
            [self.unit.variables[name].valueReference for name in values], list(values.values())
        )

    def get(self, *names) -> list[float]:
        return self.unit.get([self.unit.variables[name].valueReference for name in names])

    def outputs(self) -> list[float]:
        return self.get(*OUTPUTS)


@pytest.fixture(params=[2, 3])
def version(request) -> int:
    return request.param


def seen(plant: Plant) -> list[float]:
    return [plant.voltage_V, *plant.state, plant.cooling_power_W]


def held(cell: Cell, plant: Plant, current_A: float, periods: int) -> tuple[list, list]:
    """Outputs of both after the periods."""
    cell.set(current_A=current_A)
    plant.current_A = current_A
    for _ in range(periods):
        cell.unit.step(0.1)
        plant.advance()
    return cell.outputs(), seen(plant)


def changed(preset: Preset, **parameters: float) -> Preset:
    return replace(preset, cell=replace(preset.cell, **parameters))


@pytest.mark.parametrize("preset", [PRESET, TABLED])
def test_it_is_the_plant_of_the_bus_to_the_last_bit(tmp_path, version, preset):
    cell, plant = Cell(tmp_path, version, preset), Plant(load_preset(preset), calm())
    assert cell.outputs() == seen(plant)
    for current_A in (-20.0, 0.0, 5.0):
        unit, bus = held(cell, plant, current_A, 100)
        assert unit == bus


def test_the_start_values_are_those_of_the_preset(tmp_path, version):
    cell, nominal = Cell(tmp_path, version), nominal_cell(load_preset(PRESET))
    described = {v.name: v.start for v in plant_variables(load_preset(PRESET)) if v.is_present}
    for name in (*THERMAL, "capacity_Ah", "ohmic_resistance_ohm", "entropic_coefficient_V_per_K"):
        assert described[name] == getattr(nominal.cell, name)
    for name, start in described.items():
        assert start is None or cell.get(name) == [start]
        assert start is None or float(cell.unit.variables[name].start) == start


@pytest.mark.parametrize("name", THERMAL)
def test_a_thermal_parameter_acts_as_in_a_preset_that_has_it(tmp_path, version, name):
    """There an exponential of a block matrix by scipy, here a series in C."""
    preset = load_preset(PRESET)
    value = 1.7 * getattr(preset.cell, name)
    cell = Cell(tmp_path, version)
    before = cell.outputs()
    cell.set(**{name: value})
    plant = Plant(changed(preset, **{name: value}), calm())
    assert cell.outputs() == before, "a parameter does not move the state"
    unit, bus = held(cell, plant, -23.0, 300)
    assert unit == pytest.approx(bus, rel=1e-12)
    other, _ = held(Cell(tmp_path, version), Plant(preset, calm()), -23.0, 300)
    assert max(map(abs, (a - b for a, b in zip(unit, other)))) > 1e-3


@pytest.mark.parametrize(
    "parameters",
    [
        {"capacity_Ah": 1.9},
        {"ohmic_resistance_ohm": 0.02},
        {"entropic_coefficient_V_per_K": -2e-4},
    ],
)
def test_an_electrical_parameter_acts_as_in_a_preset_that_has_it(tmp_path, version, parameters):
    cell = Cell(tmp_path, version, **parameters)
    plant = Plant(changed(load_preset(PRESET), **parameters), calm())
    unit, bus = held(cell, plant, -23.0, 100)
    assert unit == bus


def test_a_branch_acts_as_in_a_preset_that_has_it(tmp_path, version):
    preset = load_preset(TABLED)
    branches = list(preset.cell.branches)
    branches[1] = replace(branches[1], resistance_ohm=0.01, time_constant_s=30.0)
    cell = Cell(
        tmp_path, version, TABLED, branch2_resistance_ohm=0.01, branch2_time_constant_s=30.0
    )
    plant = Plant(changed(preset, branches=tuple(branches)), calm())
    unit, bus = held(cell, plant, -3.0, 100)
    assert unit == pytest.approx(bus, rel=1e-13)
    assert cell.get("voltage_V") != Cell(tmp_path, version, TABLED).get("voltage_V")


@pytest.mark.parametrize("preset", [PRESET, TABLED])
def test_an_aged_cell_loses_more_volts_at_once(tmp_path, version, preset):
    cell = Cell(tmp_path, version, preset, current_A=-3.0)
    (loaded_V,) = cell.get("voltage_V")
    cell.set(current_A=0.0)
    (resting_V,) = cell.get("voltage_V")
    cell.set(current_A=-3.0, resistance_factor=2.0)
    assert cell.get("voltage_V")[0] - resting_V == pytest.approx(2.0 * (loaded_V - resting_V))


def test_it_starts_where_it_is_told_to(tmp_path, version):
    cell = Cell(tmp_path, version, initial_soc=0.6, initial_temperature_K=310.0)
    assert cell.get(*OUTPUTS[1:5]) == [0.6, 310.0, 310.0, 310.0]


@pytest.mark.parametrize("preset", [PRESET, TABLED])
def test_the_length_of_a_step_does_not_matter(tmp_path, version, preset):
    """Whole sub-steps give the same bits; between them the heat of the middle is a little off."""
    long, short, odd = (Cell(tmp_path, version, preset, current_A=-3.0) for _ in range(3))
    long.unit.step(2.0)
    for _ in range(20):
        short.unit.step(0.1)
    for step_s in (0.037, 0.963, 0.0045, 0.9955):
        odd.unit.step(step_s)
    assert short.outputs() == long.outputs()
    assert odd.outputs() != long.outputs()
    assert odd.outputs() == pytest.approx(long.outputs(), rel=1e-9)


def test_cooling_fades_out_above_the_floor_of_the_coolant(tmp_path, version):
    cell = Cell(tmp_path, version, initial_temperature_K=300.0, full_cooling_power_W=2.0)
    powers = []
    for floor_K in (298.0, 299.0, 299.5, 300.0, 301.0):
        cell.set(coolant_floor_K=floor_K)
        powers += cell.get("cooling_power_W")
    assert powers == pytest.approx([2.0, 2.0, 1.0, 0.0, 0.0])


def test_a_state_that_was_kept_comes_back_also_from_bytes(tmp_path, version):
    cell = Cell(tmp_path, version, current_A=-20.0)
    slave = cell.unit.slave
    cell.unit.step(1.0)
    kept = slave.getFMUState()
    written_down = slave.serializeFMUState(kept)
    cell.unit.step(1.0)
    expected = cell.outputs()
    for state in (kept, slave.deserializeFMUState(written_down)):
        slave.setFMUState(state)
        cell.unit.step(1.0)
        assert cell.outputs() == expected
        slave.freeFMUState(state)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("voltage_V", 3.3),
        ("capacity_Ah", 0.0),
        ("core_heat_capacity_J_per_K", -1.0),
        ("ohmic_resistance_ohm", float("nan")),
        ("current_A", float("inf")),
        ("initial_soc", 0.5),
    ],
)
def test_what_cannot_be_set_is_refused_and_nothing_changes(tmp_path, version, name, value):
    cell = Cell(tmp_path, version)
    before = cell.get(name)
    with pytest.raises(PlantError, match="cannot be set, a value beyond its range, or an initial"):
        cell.set(**{name: value})
    assert cell.get(name) == before


def test_a_variable_that_there_is_not_is_refused(tmp_path, version):
    cell = Cell(tmp_path, version)
    with pytest.raises(PlantError, match="no such variable"):
        cell.unit.get([999])
    with pytest.raises(PlantError):
        cell.unit.set([999], [0.0])


@pytest.mark.parametrize("step_s", [0.0, -0.1, float("nan")])
def test_a_step_of_no_length_is_refused(tmp_path, version, step_s):
    cell = Cell(tmp_path, version)
    with pytest.raises(PlantError, match="a step needs a length above 0"):
        cell.unit.step(step_s)
