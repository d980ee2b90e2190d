"""Bound on what an unmeasured core's model lacks, on cells whose core is known to the test alone.

They conduct heat through ten layers and are not the project's model (tests/bms/foreign_cells.py).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bms.calibration.family_block import family_fields
from bms.data.cycler import ColumnMap, CyclerFormat, read_cycler
from bms.identification.cell_identification import IdentifiedCell, identify_cell
from bms.identification.cell_preset import cell_preset
from bms.identification.core_disturbance import (
    LEAST_K_PER_S,
    UNTOLD_K_PER_S,
    core_disturbance,
)
from bms.identification.geometry import shape
from bms.identification.preset_check import predict
from bms.identification.rated import parse_rated, rated_limits
from bms.presets import Preset
from tests.bms.foreign_cells import CELLS, ForeignCell, Layers, Played, campaign, write

pytestmark = pytest.mark.slow
FORM = CyclerFormat(
    (ColumnMap.parse("time=0,current=1,voltage=2,surface=3,ambient=4"),), "degC", True
)
NEIGHBOUR_W = {"nmc_21700": 0.05, "lfp_prismatic": 0.5, "lto_18650": 0.03}
"""Heat that no model of the cell has, to and fro within two hours."""
CASES = [(name, seed) for name in CELLS for seed in (0, 1)]
USED = ("slow", "one", "two")
Found = Callable[[str, int], tuple[IdentifiedCell, dict[str, Played]]]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """Identified cell and all that was played, by cell and seed."""

    @cache
    def of(name: str, seed: int) -> tuple[IdentifiedCell, dict[str, Played]]:
        foreign, folder = CELLS[name], tmp_path_factory.mktemp(f"{name}_{seed}")
        played = campaign(foreign, seed, NEIGHBOUR_W[name])
        files = [
            read_cycler(write(folder / f"{part}.txt", played[part], 10 * seed + place), FORM)
            for place, part in enumerate(USED)
        ]
        return identify_cell(files, shape(foreign.geometry)), played

    return of


def preset_of(cell: IdentifiedCell, foreign: ForeignCell) -> Preset:
    rated = parse_rated([word for word in foreign.rated if "=" in word])
    return cell_preset(cell, rated_limits(rated, cell.recordings), foreign.name, {}).preset


@pytest.mark.parametrize("case", CASES)
def test_heat_that_comes_and_goes_at_rest_is_within_the_bound(
    found: Found, case: tuple[str, int]
) -> None:
    """As the firmware reckons with it, and not by far; half of the bound would not hold it."""
    foreign, truth_W = CELLS[case[0]], NEIGHBOUR_W[case[0]]
    cell, _ = found(*case)
    stated_W = family_fields(preset_of(cell, foreign))["disturbance_W"]
    assert truth_W <= stated_W <= 2.0 * truth_W
    assert 0.5 * stated_W < truth_W
    # For the cell that was measured, not the greatest of its family, but for what is smoothed off.
    inside_J_per_K = Layers(foreign, 296.0, 1.0).capacity_J_per_K[:-1].sum()
    own_W = core_disturbance(cell).bound.constant_K_per_s * inside_J_per_K
    assert own_W >= 0.9 * truth_W


@pytest.mark.parametrize("case", CASES)
def test_the_core_of_an_unused_recording_is_within_what_the_family_allows(
    found: Found, case: tuple[str, int], tmp_path: Path
) -> None:
    foreign = CELLS[case[0]]
    cell, played = found(*case)
    preset, unused = preset_of(cell, foreign), played["unused"]
    coldest_K, warmest_K = core_ends_K(preset, write(tmp_path / "unused.txt", unused, 99))
    assert np.all(coldest_K <= unused.core_K + 0.1)
    assert np.all(unused.core_K <= warmest_K + 0.1)
    # It warms by kelvins, and the ends are no wider than a few times that.
    rise_K = float(np.max(unused.core_K - unused.core_K[0]))
    assert float(np.max(warmest_K - unused.core_K)) < 4.0 * rise_K


def core_ends_K(preset: Preset, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Coldest and warmest core over the corners, from rest and measured heat, by small steps."""
    recording, cell, interval = read_cycler(path, FORM), preset.cell, preset.cell.interval
    assert interval is not None and cell.entropy is not None
    assert recording.ambient_K is not None and recording.surface_K is not None
    soc, current_A = predict(preset, recording).soc, recording.current_A
    corners = np.array(
        list(
            itertools.product(
                *(
                    [getattr(cell, f"{name}_{unit}") * factor for factor in getattr(interval, name)]
                    for name, unit in (
                        ("core_resistance", "K_per_W"),
                        ("core_heat_capacity", "J_per_K"),
                        ("surface_resistance", "K_per_W"),
                        ("surface_heat_capacity", "J_per_K"),
                    )
                )
            )
        )
    ).T
    inner, core_J_per_K, outer, surface_J_per_K = corners
    lacking = preset.uncertainty.core_K_per_s + preset.uncertainty.core_K_per_As * np.abs(current_A)
    ends = []
    for sign in (-1.0, 1.0):
        error_V = interval.ocv_error_V + interval.entropic_error_V_per_K * recording.surface_K
        heat_W = current_A * (
            cell.ocv(soc) - recording.voltage_V - cell.entropy(soc) * recording.surface_K
        ) + sign * error_V * np.abs(current_A)
        core = surface = np.full(corners.shape[1], float(np.mean(recording.surface_K[:20])))
        course = [core]
        for row, step_s in enumerate(np.diff(recording.time_s), start=1):
            for _ in range(4):
                through_W = (core - surface) / inner
                out_W = (surface - recording.ambient_K[row]) / outer
                core = core + step_s / 4.0 * (
                    (heat_W[row] - through_W) / core_J_per_K + sign * lacking[row]
                )
                surface = surface + step_s / 4.0 * (through_W - out_W) / surface_J_per_K
            course.append(core)
        ends.append(np.array(course))
    return ends[0].min(axis=1), ends[1].max(axis=1)


def only(cell: IdentifiedCell, *places: int) -> IdentifiedCell:
    """With some of its recordings."""
    alignment = replace(
        cell.alignment,
        soc=tuple(cell.alignment.soc[place] for place in places),
        specimens=tuple(cell.alignment.specimens[place] for place in places),
    )
    recordings = tuple(cell.recordings[place] for place in places)
    return replace(cell, recordings=recordings, alignment=alignment)


def test_without_half_an_hour_at_rest_strong_currents_speak_for_it_and_it_is_said(
    found: Found,
) -> None:
    cell, _ = found("nmc_21700", 0)
    told = core_disturbance(only(cell, 1, 2))
    assert told.remark is not None and "half an hour at C/8 or less" in told.remark
    assert "of strong currents" in told.at_rest
    assert core_disturbance(cell).remark is None


def test_slow_recordings_alone_leave_the_growth_assumed(found: Found) -> None:
    cell, _ = found("nmc_21700", 0)
    told = core_disturbance(only(cell, 0))
    assert told.growing.startswith("assumed")
    assert told.bound(np.array([cell.alignment.capacity_Ah]))[0] >= UNTOLD_K_PER_S
    assert told.bound.constant_K_per_s == core_disturbance(cell).bound.constant_K_per_s


def test_a_cell_that_its_model_follows_has_the_least_bound_and_one_that_did_not_warm_more(
    found: Found,
) -> None:
    cell, _ = found("nmc_21700", 0)
    assert core_disturbance(cell).bound.constant_K_per_s > LEAST_K_PER_S
    cold = replace(cell, is_thermal_fitted=False)
    assert core_disturbance(cold).bound.constant_K_per_s == UNTOLD_K_PER_S
