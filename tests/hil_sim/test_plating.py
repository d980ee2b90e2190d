"""Current maps from the anode potential: the largest that holds, on a cell of known answer."""

import importlib.util
import json
import os
import sys
from dataclasses import dataclass

import pytest

from bms.errors import InputError
from bms.presets.schema import CurrentMap
from bms.validation import parse, read_toml
from hil_sim.plant.electrochemistry import Outputs
from hil_sim.studies.plating.charges import FULL, least_anode_potential_V, strongest_currents
from hil_sim.studies.plating.current_map import derive_map, mapped_A, steps

needs_pybamm = pytest.mark.skipif(
    importlib.util.find_spec("pybamm") is None
    and ("CI" not in os.environ or sys.version_info < (3, 11)),
    reason="not run: PyBaMM is not installed; it comes with the extra pybamm",
)
MOST_A = 10.0


@dataclass
class Resistor:
    """Anode potential 0.12 - 0.1 s - R |u|: plates beyond (0.12 - 0.1 s) / R, R falling with T."""

    capacity_As: float = 3600.0
    soc: float = 0.0
    reached: float = 0.0

    @staticmethod
    def plates_at_A(temperature_K, soc):
        ohm = 0.04 - 0.0005 * (temperature_K - 273.0)
        return (0.12 - 0.1 * soc) / ohm

    def step(self, current_A, temperature_K, step_s=1.0):
        self.reached = self.soc - current_A * step_s / self.capacity_As
        return self._at(self.soc, current_A, temperature_K), self._at(
            self.reached, current_A, temperature_K
        )

    def _at(self, soc, current_A, temperature_K):
        own_V = 0.12 - 0.1 * soc
        drop_V = -current_A * own_V / self.plates_at_A(temperature_K, soc)
        return Outputs(3.3, 0.0, own_V - drop_V, soc)

    def keep(self):
        self.soc = self.reached

    def restart(self):
        self.soc = 0.0


@pytest.mark.parametrize("temperature_K", [273.0, 293.0, 313.0])
def test_strongest_current_is_where_the_anode_just_keeps_its_margin(temperature_K):
    soc, strength_A = strongest_currents(Resistor(), temperature_K, 0.0, MOST_A)

    for charge, current_A in zip(soc, strength_A):
        expected_A = min(Resistor.plates_at_A(temperature_K, charge), MOST_A)
        assert current_A == pytest.approx(expected_A, abs=0.01)
    assert soc[-1] == pytest.approx(FULL, abs=2e-3)


def test_a_charge_that_the_margin_ends_is_reported_with_0_A():
    soc, strength_A = strongest_currents(Resistor(), 273.0, 0.07, MOST_A)

    assert soc[-1] == pytest.approx(0.5, abs=0.02)
    assert strength_A[-1] == 0.0


def test_map_is_as_large_as_the_model_allows_and_holds_between_its_points():
    """The limit is linear in the charge, so a map with these rows can reach it."""
    result = derive_map(Resistor(), (273.0, 283.0, 293.0), (0.0, 0.5, 1.0), MOST_A)

    for temperature_K, row in zip(result.map.temperature_K, result.map.largest_A):
        for soc, largest_A in zip(result.map.soc, row):
            exact_A = Resistor.plates_at_A(temperature_K, soc)
            assert exact_A - 0.3 < largest_A <= exact_A + 0.01
    assert len(result.checks) == steps((273.0, 283.0, 293.0)) / 2
    assert min(check.anode_potential_V for check in result.checks) > -2e-4
    assert max(check.anode_potential_V for check in result.checks) < 5e-3


def test_check_sees_a_map_that_allows_too_much():
    allowed = derive_map(Resistor(), (273.0, 293.0), (0.0, 1.0), MOST_A).map
    more = CurrentMap(
        allowed.temperature_K,
        allowed.soc,
        tuple(tuple(1.2 * value for value in row) for row in allowed.largest_A),
    )

    least_V, soc = least_anode_potential_V(Resistor(), 273.0, lambda s: mapped_A(more, 273.0, s))

    assert least_V < -0.003
    assert 0.0 <= soc <= 1.0


def test_margin_lowers_the_map_to_nothing_where_it_cannot_be_kept():
    result = derive_map(Resistor(), (273.0, 293.0), (0.0, 0.5, 1.0), MOST_A, margin_V=0.05)

    assert result.map.largest_A[0][2] == 0.0
    assert result.map.largest_A[0][0] > 1.0
    assert min(check.anode_potential_V for check in result.checks) > 0.05 - 1e-3


def test_data_sheets_current_caps_the_map():
    result = derive_map(Resistor(), (293.0, 313.0), (0.0, 1.0), 0.5)

    assert result.map.largest_A == ((0.5, 0.5), (0.5, 0.5))


@pytest.mark.parametrize("axis", [(293.0, 273.0), (293.0, 293.0), (293.0,)])
def test_axes_have_to_rise(axis):
    with pytest.raises(InputError, match="temperature_K"):
        derive_map(Resistor(), axis, (0.0, 1.0), MOST_A)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--physics", "p2d"], "--physics p2d"),
        (["--out", "map.csv"], "map.csv"),
        (["--soc", "0,x"], "--soc"),
        (["--temperatures", ",".join(str(280 + i) for i in range(9))], "at most 8"),
    ],
)
def test_wrong_use_is_one_line_and_exit_2(bms, arguments, told):
    code, out, err = bms("plating", *arguments)

    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert told in err


@needs_pybamm
@pytest.mark.slow
def test_command_derives_a_map_of_pradas_cell(bms, tmp_path):
    path = tmp_path / "map.toml"
    arguments = ("plating", "--temperatures", "285,305", "--soc", "0,0.5,1", "--out", path)

    code, out, _ = bms(*arguments, "--json")

    result = json.loads(out)
    assert code == 0
    written = parse(CurrentMap, read_toml(path)["current_map"], "map.toml")
    assert [list(row) for row in written.largest_A] == result["map"]["largest_A"]
    assert written.largest_A[0][2] < 3.0 < written.largest_A[1][0] <= 10.0
    assert all(check["anode_potential_V"] > -1e-3 for check in result["checks"])


@needs_pybamm
def test_set_that_pybamm_lacks_is_told(bms):
    code, _, err = bms("plating", "--set", "Nobody2000")

    assert code == 2
    assert "no parameter set 'Nobody2000'" in err
