"""A cell of a pack that is another plant: it is part of the string, and kept within its limits."""

from __future__ import annotations

import importlib
import json
import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from bms.cell import CellState
from bms.errors import InputError, PlantError
from bms.model.pair import load_pair
from hil_sim.bus.catalog import FirstFault
from hil_sim.pack import foreign_cells
from hil_sim.pack.cell_plants import cell_plants
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.plant import PackPlant
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.summary import margins
from hil_sim.plant.electrochemistry import import_pybamm
from hil_sim.plant.heated_masses import HeatedMasses
from hil_sim.plant.plant import Extremes
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.spread import Surroundings
from tests.hil_sim.plants import started

PAPER, FAMILY = load_pair("paper_calibrated", None), load_pair("a123_26650_10C", None)
CLOSE = Surroundings(neighbour_W_per_K=0.3, flow_W_per_K=5.0)
"""More heat between cells than by default, so that all of it shows."""
SAME_K, SAME_V = 1e-6, 1e-7
"""By which the C plant's cell and the same one through the seam may differ: what others do at the
end of a sub-step is foretold by the one and known to the other."""
CURRENTS_A = (*(0.0,) * 20, *(-20.0,) * 300, *(-3.0,) * 200, *(0.0,) * 80)

needs_pybamm = pytest.mark.skipif(
    importlib.util.find_spec("pybamm") is None
    and ("CI" not in os.environ or sys.version_info < (3, 11)),
    reason="not run: PyBaMM is not installed; it comes with the extra pybamm",
)


def pack_of(pair, cells=4, soc=0.3, temperature_K=298.15, **changes):
    preset, model = pair
    return PackChargeSettings(started(preset, soc, temperature_K), model, cells, **changes)


def truths(plant, cells):
    states = [plant.fields.plant.cell[i].memory.state for i in range(cells)]
    return [value for s in states for value in (s.soc, s.core, s.surface, s.coolant)]


def readings(plant, cells):
    read = plant.measured
    return [*read.voltage_V[0:cells], *read.surface_temperature_K[0:cells], read.coolant_out_K,
            plant.pack_voltage_V]  # fmt: skip


def own_cells(pair, plants, cells=4):
    """The pack with C cells alone, and with some of the same cells through the seam."""
    settings = pack_of(pair, cells, seed=3, around=CLOSE)
    return PackPlant(settings), PackPlant(replace(settings, cell_plants=plants))


@pytest.mark.parametrize("pair", [PAPER, FAMILY], ids=["paper", "family"])
@pytest.mark.parametrize("at", [(0,), (1,), (3,), (1, 2)])
def test_the_projects_own_cell_through_the_seam_is_the_c_plants_cell(pair, at):
    """Truth of every cell, what its sensors read, peaks; at both ends of the string and within."""
    own, foreign = own_cells(pair, tuple((cell, "two-mass") for cell in at))
    for current_A in CURRENTS_A:
        for plant in (own, foreign):
            plant.measure()
            plant.hold(current_A)
        assert readings(foreign, 4) == readings(own, 4)
        assert truths(foreign, 4) == pytest.approx(truths(own, 4), abs=SAME_K)
    volts = [[plant.voltage_V(cell) for cell in range(4)] for plant in (own, foreign)]
    assert volts[1] == pytest.approx(volts[0], abs=SAME_V)
    assert foreign.peaks() == pytest.approx(own.peaks(), abs=SAME_K)
    assert foreign.core_K() == pytest.approx(own.core_K(), abs=SAME_K)


def test_without_the_heat_of_others_it_is_another_cell(monkeypatch):
    monkeypatch.setattr(foreign_cells, "_coupling", lambda cell: (0.0, 0.0))
    own, foreign = own_cells(PAPER, ((0, "two-mass"),))
    for current_A in CURRENTS_A:
        for plant in (own, foreign):
            plant.measure()
            plant.hold(current_A)
    assert abs(foreign.core_K()[0] - own.core_K()[0]) > 1000 * SAME_K


def test_the_same_cell_gives_the_same_frames_in_a_charge_that_ends_in_balancing():
    """Foreign are the cells that are bled, so that what a resistor takes is in it.

    Where a truth lies within SAME_K of the middle between two steps of a sensor, its rounding tips.
    """
    settings = pack_of(PAPER, soc=0.93, seed=1, bleed_ohm=10.0, balance_s=60.0)
    runs = []
    for plants in ((), ((1, "two-mass"), (2, "two-mass"))):
        sent, read, true = [], [], []

        def keep(frames, sent=sent):
            sent.append(frames)
            return frames

        def note(plant, read=read, true=true):
            read.append(readings(plant, 4))
            true.append(truths(plant, 4))

        result = charge_pack(
            replace(settings, cell_plants=plants),
            tamper=note,
            sent=keep,
        )
        assert result.reason == "complete"
        runs.append((sent, np.array(read), np.array(true), result))
    (own_sent, own_read, own_true, own), (sent, read, true, foreign) = runs
    assert np.abs(true - own_true).max() < 5 * SAME_K, "most where the coolant begins to flow"
    others = [period for period, frames in enumerate(own_sent) if sent[period] != frames]
    assert len(own_sent) == len(sent) > 800 and len(others) <= 3
    surface_K = settings.preset.sensors.surface_temperature_K.resolution
    assert np.abs(read - own_read).max() < 1.01 * surface_K
    assert foreign.commands_A == pytest.approx(own.commands_A, abs=0.005)
    assert foreign.final_socs == pytest.approx(own.final_socs, abs=1e-7)
    bled = np.array(own.full_socs) - own.final_socs
    assert min(bled[1], bled[2]) > 0.002


class Heater:
    """A cell that makes the same heat whatever flows in it, in the masses of its preset."""

    HEAT_W, OHM = 5.0, 0.01

    def __init__(self, argument, preset, disturbance):
        self._masses, self._period_s = HeatedMasses(preset, disturbance), 0.1
        self._capacity_As = preset.cell.capacity_As
        self.current_A, self.cooling_power_W = 0.0, preset.initial.cooling_power_W
        self.extremes = Extremes(*[preset.initial.temperature_K] * 2, 3.3, preset.initial.soc)

    @property
    def state(self):
        return self._masses.state

    @property
    def voltage_V(self):
        return 3.3 - self.OHM * self.current_A

    def advance(self):
        soc = self.state.soc - self.current_A * self._period_s / self._capacity_As
        self._masses.advance(self.HEAT_W, soc, self.cooling_power_W, self.extremes)


def stored_J(plant, start_K, cells):
    """Heat in all masses of the pack above its start."""
    total = 0.0
    for i in range(cells):
        one = plant.fields.plant.cell[i]
        state, cell = one.memory.state, one.cell
        total += cell.core_heat_capacity_J_per_K * (state.core - start_K)
        total += cell.surface_heat_capacity_J_per_K * (state.surface - start_K)
        total += cell.coolant_heat_capacity_J_per_K * (state.coolant - start_K)
    return total


def heated_pack(monkeypatch, periods=1200):
    """A pack at rest whose second cell is a heater; heat in it beyond what came in, and that."""
    monkeypatch.setattr(foreign_cells, "make_plant", lambda spec, *given: Heater("", *given))
    settings = pack_of(PAPER, cell_plants=((1, "heater"),), around=CLOSE, disturbed=False)
    plant = PackPlant(settings)
    for _ in range(periods):
        plant.measure()
        plant.hold(None)
    cooling_W = 4 * settings.preset.initial.cooling_power_W
    came_in_J = (Heater.HEAT_W - cooling_W) * periods * 0.1
    return plant, stored_J(plant, settings.preset.initial.temperature_K, 4) - came_in_J, came_in_J


def test_a_foreign_cells_heat_goes_to_its_neighbours_and_along_the_coolant_and_none_is_lost(
    monkeypatch,
):
    plant, missing_J, came_in_J = heated_pack(monkeypatch)
    assert abs(missing_J) < 1e-4 * came_in_J
    cells = [plant.fields.plant.cell[i].memory.state for i in range(4)]
    surfaces = [one.surface for one in cells]
    assert surfaces[1] > surfaces[2] + 3.0 and surfaces[2] > surfaces[3] + 1.0
    assert cells[1].coolant > cells[0].coolant + 0.1


def test_the_balance_would_tell_of_heat_that_does_not_come_back(monkeypatch):
    monkeypatch.setattr(foreign_cells, "_coupling", lambda cell: (0.0, 0.0))
    _, missing_J, came_in_J = heated_pack(monkeypatch)
    assert abs(missing_J) > 0.1 * came_in_J


def test_the_string_has_the_foreign_cells_share_of_its_voltage(monkeypatch):
    monkeypatch.setattr(foreign_cells, "make_plant", lambda spec, *given: Heater("", *given))
    settings = pack_of(PAPER, cell_plants=((1, "heater"),))
    plant = PackPlant(settings)
    plant.hold(-10.0)
    plant.measure()
    assert plant.voltage_V(1) == pytest.approx(3.4)
    error_V = settings.preset.sensors.voltage_V.error_bound
    assert plant.measured.voltage_V[1] == pytest.approx(3.4, abs=error_V)
    total_V = sum(plant.voltage_V(cell) for cell in range(4))
    assert plant.pack_voltage_V == pytest.approx(
        total_V, abs=settings.pack_voltage_sensor.error_bound
    )


ELECTRODES = ((2, "pybamm:spme,contact=1e-2"),)
"""PyBaMM's cell with contacts that make it the one whose voltage ends the full current."""


@pytest.fixture(scope="module")
def charged():
    """A whole charge of four cells of a family, one of which is porous electrodes."""
    return charge_pack(pack_of(FAMILY, soc=0.7, cell_plants=ELECTRODES))


@needs_pybamm
def test_a_pack_with_a_cell_of_porous_electrodes_is_full_and_no_cell_crosses_a_limit(charged):
    assert charged.reason == "complete"
    assert (margins(charged) >= 0.0).all()
    assert charged.latched_faults == 0
    assert charged.governed[3] > 1000, "it is the cell that had to be spared"
    assert margins(charged)[2, 3] < 0.02, "and was taken to where its voltage ends"


@needs_pybamm
def test_the_foreign_cell_is_no_cell_of_the_pack(charged):
    own = charge_pack(pack_of(FAMILY, soc=0.7))
    assert own.reason == "complete"
    assert abs(charged.peaks[2, 3] - own.peaks[2, 3]) > 0.02
    assert abs(charged.final_socs[2] - own.final_socs[2]) > 0.01
    assert charged.charge_periods > own.charge_periods + 100
    assert charged.least_anode_V is not None and own.least_anode_V is None


@needs_pybamm
def test_were_its_voltage_not_reported_it_would_cross_the_limit(monkeypatch):
    """The drawn cell's in its place, to the ECU in page and string."""

    def of_stand_in(plant, cell):
        pack = ffi.addressof(plant.fields, "plant")
        return float(lib.plant_voltage_V(pack, cell, plant.fields.current_A))

    monkeypatch.setattr(PackPlant, "voltage_V", of_stand_in)
    result = charge_pack(pack_of(FAMILY, soc=0.7, cell_plants=ELECTRODES, max_time_s=100.0))
    assert margins(result)[2, 3] < -0.01
    assert (margins(result)[[0, 1, 3], 3] >= 0.0).all()


@pytest.mark.parametrize(
    ("named", "said"),
    [
        (["3"], "--cell-plant 3: write the cell's number and its plant, such as 3=pybamm"),
        (["3="], "write the cell's number"),
        (["third=pybamm"], "write the cell's number"),
        (["-1=pybamm"], "write the cell's number"),
        (["0=pybamm"], "--cell-plant 0=pybamm: cell 0: the pack has cells 1 to 4"),
        (["5=pybamm"], "--cell-plant 5=pybamm: cell 5: the pack has cells 1 to 4"),
        (["3=pybamm", "3=two-mass"], "--cell-plant 3=two-mass: cell 3 is named twice"),
    ],
)
def test_cells_that_cannot_be_meant_are_refused(named, said):
    with pytest.raises(InputError) as refused:
        cell_plants(named, 4)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_cells_count_from_1_and_a_plant_may_have_equals_signs():
    named = ["4=recorded:a.csv,soc=0.3", "1=pybamm"]
    assert cell_plants(named, 4) == ((0, "pybamm"), (3, "recorded:a.csv,soc=0.3"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--cells 4 --cell-plant 3=nothing", "--cell-plant 3=nothing: no plant 'nothing'; take"),
        ("--cells 4 --cell-plant 2=two-mass:9", "--cell-plant 2=two-mass:9: takes nothing"),
        ("--cells 4 --cell-plant 2=recorded:no.csv", "--cell-plant 2=recorded:no.csv: no.csv:"),
        (
            "--cells 4 --cell-plant 1=fmu:cell.fmu",
            "--cell-plant 1=fmu:cell.fmu: a unit takes no heat from its neighbours and the coolant",
        ),
        ("--cells 4 --cell-plant 5=two-mass", "cell 5: the pack has cells 1 to 4"),
        ("--cell-plant 1=two-mass", "--cell-plant: are for a pack; add --cells"),
        ("--cells 4 --plant two-mass:9", "--plant: is for one cell; leave it out"),
    ],
)
def test_the_command_refuses_in_one_line_and_leaves_nothing(bms, tmp_path, options, said):
    code, out, err = bms("sil", *options.split(), "--out", tmp_path / "out")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert said in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [("--cells", 2, "--cell-plant", "3=two-mass"), ()])
def test_plant_refuses_as_sil_does(bms, options):
    bus = ("--bus", "udp_multicast:239.74.163.92")
    code, out, err = bms("plant", *bus, *(options or ("--cell-plant", "1=two-mass")))
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "--cell-plant" in err


def test_without_pybamm_the_extra_is_named(monkeypatch):
    import_pybamm.cache_clear()
    monkeypatch.setitem(sys.modules, "pybamm", None)
    said = r"--cell-plant 3=pybamm: PyBaMM is not installed; run pip install"
    with pytest.raises(InputError, match=said):
        PackPlant(pack_of(FAMILY, cell_plants=((2, "pybamm"),)))
    import_pybamm.cache_clear()


@pytest.mark.parametrize(("taken", "said"), [(0, "takes no heat"), (12, "asks for more knots")])
def test_a_plant_that_leaves_its_disturbance_out_or_wants_another_is_refused(
    monkeypatch, taken, said
):
    class Other:
        state, voltage_V, current_A, cooling_power_W = CellState(0.5, *[298.15] * 3), 3.3, 0.0, 0.0

        def __init__(self, knots):
            self._knots = knots

        def advance(self):
            for _ in range(taken):
                next(self._knots)

    monkeypatch.setattr(foreign_cells, "make_plant", lambda spec, preset, knots: Other(knots))
    plant = PackPlant(pack_of(PAPER, cell_plants=((2, "mine"),)))
    with pytest.raises(InputError, match=f"--cell-plant 3=mine: {said}"):
        plant.hold(-1.0)


def test_a_cell_without_a_solution_says_which_it_is(monkeypatch):
    def fails(self):
        raise PlantError("PyBaMM: no solution with -9 A")

    monkeypatch.setattr(foreign_cells, "make_plant", lambda spec, *given: Heater("", *given))
    monkeypatch.setattr(Heater, "advance", fails)
    plant = PackPlant(pack_of(PAPER, cell_plants=((2, "mine"),)))
    with pytest.raises(PlantError, match="--cell-plant 3=mine: PyBaMM: no solution with -9 A"):
        plant.hold(-1.0)


def test_a_cell_that_is_none_that_the_preset_describes_is_a_fault_and_no_harm(monkeypatch):
    """The heater's voltage is not that of its state of charge."""
    monkeypatch.setattr(foreign_cells, "make_plant", lambda spec, *given: Heater("", *given))
    monkeypatch.setattr(Heater, "OHM", 0.05)
    result = charge_pack(pack_of(PAPER, cell_plants=((2, "mine"),)))
    assert result.reason == "fault"
    assert (result.first_fault, result.faulty_cell) == (FirstFault.VOLTAGE_DEVIATION, 3)
    assert (margins(result) >= 0.0).all()


def test_summary_page_and_text_name_the_plants(bms, tmp_path):
    options = ("--cells", 3, "--cell-plant", "2=two-mass", "--max-time-s", 3)
    code, out, _ = bms("sil", *options, "--out", tmp_path / "out")
    assert code == 1
    assert "cell 2 is two-mass" in out
    said = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert said["cell_plants"] == {"2": "two-mass"}
    assert said["min_anode_potential_V"] is None
    assert [row["cell"] for row in said["worst_margins"]] == [1, 2, 3]
    assert "cell 2 is two-mass" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize(("over", "is_over"), [(0.005, False), (0.0051, True)])
def test_a_cell_of_a_family_is_overfilled_where_a_campaign_says_so(over, is_over):
    """It is full by its voltage, so that its true state of charge may be a little over 1."""
    preset, model = load_pair("a123_26650_10C", None)
    result = charge_pack(PackChargeSettings(preset, model, 2, max_time_s=1.0))
    result.peaks[0, 0] = 1.0 + over
    assert (margins(result) < 0.0).any() == is_over
