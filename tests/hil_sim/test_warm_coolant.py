"""How warm the coolant may be for which a family's limits are kept: held from both sides.

Starts that no random draw hits: the coolant is as warm as it can be for the cell to keep its limits
without a current, with every disturbance upward. What a charge before the peak adds then counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from bms.cell import CellState
from bms.model import load_shipped_model
from bms.presets import Preset, load_preset
from bms.verification.family_coolant import warmest_coolant_K
from hil_sim.native.cell_fields import thermal_matrix_per_s
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.true_cell import TrueCell
from hil_sim.studies.campaign.engine import Scenario
from hil_sim.studies.campaign.noise import streams
from hil_sim.studies.campaign.real_draws import LEAST_COOLING, disturbance_W, draw_real
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily
from hil_sim.studies.campaign.worker import play

SEED, LONGEST_S, STEP_S = 77, 9000.0, 5.0


def highest_at_rest_K(preset: Preset, cell: TrueCell, state: CellState) -> np.ndarray:
    """Highest core and surface temperature at 0 A with all disturbances upward, in K.

    What the branches still hold is taken to heat the core at once, which is more than they do.
    """
    bounds, parameters = preset.uncertainty, cell.cell
    heating = [
        bounds.core_K_per_s,
        bounds.surface_K_per_s,
        bounds.coolant_K_per_s - cell.cooling_power_W / parameters.coolant_heat_capacity_J_per_K,
    ]
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = thermal_matrix_per_s(parameters), heating
    step = expm(matrix * STEP_S)
    branch_J = sum(
        0.5 * voltage_V**2 * branch.time_constant_s / branch.resistance_ohm
        for voltage_V, branch in zip(cell.polarisation_V, parameters.branches)
    )
    course = np.array([*state[1:], 1.0])
    course[0] += branch_J / parameters.core_heat_capacity_J_per_K
    highest = course[:2]
    for _ in range(int(LONGEST_S / STEP_S)):
        course = step @ course
        highest = np.maximum(highest, course[:2])
    return highest


def excess_K(preset: Preset, run: int, warmest_K: float = np.inf) -> float:
    """By how much a charge takes the core over its limit, from such a start up to a coolant."""
    limits = preset.limits
    model = replace(load_shipped_model(preset.name), training_hash=preset.training_hash)
    settings = CampaignSettings(preset, model, 1, 0, LONGEST_S, family=CellFamily.REAL)
    numbers, random = streams(SEED, run), np.random.default_rng(run)
    drawn = draw_real(preset, LONGEST_S, numbers.draw)
    limit_K = limits.max_core_temperature_K
    surface_K = limit_K - random.uniform(1.0, 8.0)
    core_K = surface_K + random.uniform(-0.5, 0.5)
    share = random.uniform() * random.uniform()
    most_W = preset.operating_box.cooling_power_W[1]
    cooling_W = max(LEAST_COOLING * disturbance_W(preset, drawn.cell.cell), share * most_W)
    cell = replace(drawn.cell, cooling_power_W=cooling_W)
    low_K = surface_K - 5.0
    high_K = min(
        surface_K + preset.plug_in.coolant_offset_K, preset.operating_box.coolant_temperature_K[1]
    )
    for _ in range(14):
        coolant_K = 0.5 * (low_K + high_K)
        state = CellState(cell.state.soc, core_K, surface_K, coolant_K)
        allowed_K = limit_K - 0.02, limits.max_surface_temperature_K - 0.02
        if np.all(highest_at_rest_K(preset, cell, state) <= allowed_K):
            low_K = coolant_K
        else:
            high_K = coolant_K
    coolant_K = min(low_K, warmest_K)
    start = CellState(cell.state.soc, core_K, surface_K, coolant_K)
    cell = replace(cell, state=start, coolant_floor_K=min(cell.coolant_floor_K, coolant_K - 20.0))
    attack = replace(drawn, cell=cell, disturbance=DisturbanceKind.UPWARD)
    charge = play(Scenario(settings), settings, attack, numbers, controllers=["kan-rcbf"])
    peaks = charge["kan-rcbf"].fields.peaks.cell
    return float(peaks.core_temperature_K) - limit_K


def restless() -> Preset:
    """samsung_30q, if its recordings left 0.0042 K/s of the core unexplained at rest."""
    preset = load_preset("samsung_30q")
    uncertainty = replace(preset.uncertainty, core_K_per_s=0.00419, core_K_per_As=7.53e-5)
    coldest_K, _ = preset.operating_box.coolant_temperature_K
    box = replace(preset.operating_box, coolant_temperature_K=(coldest_K, 326.15))
    return replace(preset, uncertainty=uncertainty, operating_box=box)


@pytest.mark.slow
def test_beside_a_coolant_within_the_stated_one_no_core_crosses_its_limit() -> None:
    preset = restless()
    for run in (100, 101, 145, 146):
        assert excess_K(preset, run, warmest_coolant_K(preset)) <= 0.0, run


@pytest.mark.slow
def test_beside_a_warmer_one_some_do() -> None:
    preset = restless()
    assert excess_K(preset, 101) > 0.3
    assert excess_K(preset, 146) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("run", [100, 101, 145, 146])
def test_the_shipped_30q_keeps_its_limits_beside_every_coolant_of_its_box(run: int) -> None:
    assert excess_K(load_preset("samsung_30q"), run) <= 0.0


def test_the_box_of_the_shipped_30q_ends_where_its_limits_are_not_kept_any_more() -> None:
    preset = load_preset("samsung_30q")
    _, warmest_K = preset.operating_box.coolant_temperature_K
    assert warmest_coolant_K(preset) - 0.01 < warmest_K <= warmest_coolant_K(preset)


@pytest.mark.slow
@pytest.mark.parametrize("run", [3, 44, 94, 162])
def test_the_family_of_the_a123_keeps_its_limits_beside_all_that_were_tried(run: int) -> None:
    assert excess_K(load_preset("a123_26650_10C"), run) <= 0.0


def test_the_reserve_is_what_the_disturbances_make_of_the_resistances_to_the_coolant() -> None:
    """a123_26650: 0.0005 K/s on 62.7 and 4.5 J/K, over 1.94 and 3.19 K/W, each 1.2 times."""
    preset = load_preset("a123_26650")
    core_W, surface_W = 0.0005 * 1.2 * 62.7, 0.0005 * 1.2 * 4.5
    below_K = 1.2 * 1.94 * core_W + 1.2 * 3.19 * (core_W + surface_W)
    assert warmest_coolant_K(preset) == pytest.approx(323.0 - below_K, abs=1e-9)
