"""A cell of another kind than any in the repository, by `bms identify` alone.

The electrochemical cell of tests/bms/electrochemical_cell.py is independent of the model that is
fitted to it, so that the stated intervals, and the end of a charge, are held by a second plant.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest

from bms.data.cycler import ColumnMap, CyclerFormat, read_cycler
from bms.identification.cell_identification import identify_cell
from bms.identification.cell_preset import CellPreset, cell_preset
from bms.identification.geometry import shape
from bms.identification.preset_check import check_preset
from bms.identification.preset_toml import preset_toml
from bms.identification.rated import parse_rated, rated_limits
from bms.presets.authoring.complaints import complaints
from tests.bms.electrochemical_cell import CAPACITY_AH, recordings

FORM = CyclerFormat(
    (ColumnMap.parse("time=0,current=1,voltage=2,surface=3,ambient=4"),), "degC", True
)
RATED = parse_rated(["max_charge_A=2.2", "max_voltage_V=4.2", "charge_temperature_degC=0..45"])

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("pybamm") is None
        and ("CI" not in os.environ or sys.version_info < (3, 11)),
        reason="not run: PyBaMM is not installed; it comes with the extra pybamm",
    ),
]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return recordings(tmp_path_factory.mktemp("foreign"))


@pytest.fixture(scope="module")
def made(files: dict[str, Path]) -> CellPreset:
    used = [read_cycler(path, FORM) for name, path in files.items() if name != "charge"]
    cell = identify_cell(used, shape("18650"))
    return cell_preset(cell, rated_limits(RATED, cell.recordings), "foreign", {})


def test_a_charge_that_was_not_used_is_within_the_intervals(
    made: CellPreset, files: dict[str, Path]
) -> None:
    check = check_preset(made.preset, read_cycler(files["charge"], FORM))
    assert check.voltage_covered >= 0.95
    assert check.surface_covered is not None and check.surface_covered >= 0.95
    assert check.voltage_rmse_V <= 0.025
    assert made.preset.cell.capacity_Ah == pytest.approx(CAPACITY_AH, rel=0.1)


def test_the_preset_is_complete_and_a_charge_can_be_proven_full(
    made: CellPreset, tmp_path: Path
) -> None:
    path = tmp_path / "foreign.toml"
    path.write_text(preset_toml(made.preset, made.notes), encoding="utf-8")
    assert complaints(path) == []
    # Less half a percent of the recordings' full cell, which was the rule, was never reached.
    assert 0.93 < made.preset.limits.completion_soc < 0.97
