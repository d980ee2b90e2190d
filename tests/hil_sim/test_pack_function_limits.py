"""What is allowed for 10 s, at each of its thermal limits by hand, with one constant at a time."""

from functools import cache

import numpy as np
import pytest

from bms.model.pair import load_pair
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import Core
from tests.hil_sim.pack_rig import PackRig, ordinary

PRESET, MODEL = load_pair("paper_calibrated", None)
STRONGEST_A = PRESET.limits.reference_current_A
STEP_A = 0.02  # it is found by halving
SURFACE_LIMIT_K = 318.0
HORIZON = (
    *("core_above_estimate_K", "core_K_per_W", "core_K", "surface_per_core"),
    *("surface_per_coolant", "surface_per_warmer_coolant", "surface_K"),
    *("coolant_per_core", "coolant_per_surface", "coolant_K"),
)


@cache
def charging():
    rig = PackRig(Core(PRESET, MODEL, ordinary("paper_calibrated")), 2)
    rig.step(60)
    rig.step(charge=True)
    assert rig.pack.state == lib.BMS_CHARGING
    return rig


def pack_of(core_limit_K, surface_limit_K):
    """A charging pack with limits of its own, so that one of them alone decides."""
    limits = charging().core.calibration.rcbf
    limits.max_core_temperature_K.high_K = core_limit_K
    limits.max_surface_temperature_K.high_K = surface_limit_K
    return charging()


def allowed_A(rig, worst, **horizon):
    """In the worst cell's surface, core estimate and coolant in K; what is not given is 0."""
    surface_K, estimate_K, coolant_K = worst
    state = {"soc": 0.3, "surface_K": surface_K, "estimate_K": estimate_K, "coolant_K": coolant_K}
    given = dict.fromkeys(HORIZON, 0.0) | {"horizon_s": 10.0} | horizon
    return lib.pack_function_A(
        rig.pack, ffi.new("pack_worst_t *", state), ffi.new("pack_horizon_t *", given)
    )


@pytest.mark.parametrize(
    ("surface_K", "coolant_K", "horizon"),
    [
        (318.0, 318.0, {}),
        (318.0, 300.0, {"surface_per_coolant": 0.5, "surface_per_core": 0.5}),
        (316.0, 300.0, {"surface_K": 2.0}),
        (316.0, 326.0, {"surface_per_warmer_coolant": 0.2, "surface_per_coolant": 0.9}),
        (316.0, 324.0, {"surface_per_warmer_coolant": 0.2, "coolant_K": 2.0}),
        (316.0, 306.0, {"surface_per_warmer_coolant": 0.5, "coolant_per_surface": 1.4}),
        (316.0, 306.0, {"surface_per_warmer_coolant": 0.5, "coolant_per_core": 1.4}),
        (316.0, 306.0, {"surface_per_core": 1.0, "core_K": 2.0}),
        (316.0, 306.0, {"surface_per_core": 1.0, "core_above_estimate_K": 2.0}),
    ],
)
def test_a_surface_that_comes_to_its_limit_allows_all_and_one_that_passes_it_nothing(
    surface_K, coolant_K, horizon
):
    """318 K by arithmetic; where it would cool, what it is now counts."""
    rig = pack_of(400.0, SURFACE_LIMIT_K)
    for beside_K, expected_A in ((-0.01, STRONGEST_A), (0.01, 0.0)):
        worst = (surface_K + beside_K, surface_K + beside_K, coolant_K + beside_K)
        assert allowed_A(rig, worst, **horizon) == expected_A


@pytest.mark.parametrize(
    "horizon",
    [{"surface_per_core": 1.0}, {"coolant_per_core": 0.9, "surface_per_warmer_coolant": 1.25}],
)
def test_a_surface_that_the_core_warms_allows_the_current_of_that_heat(horizon):
    """4 W bring the core to 318 K, and the surface, or the coolant and so the surface, too."""
    rig = pack_of(400.0, SURFACE_LIMIT_K)
    calibration = rig.core.calibration
    entropic_V = calibration.thermal.entropic_coefficient_V_per_K * 400.0
    strength_A = max(np.roots([calibration.rcbf.ohmic_resistance_ohm, entropic_V, -4.0]))
    core = {"core_above_estimate_K": 4.0, "core_K": 1.0, "core_K_per_W": 2.0}
    got_A = allowed_A(rig, (314.0, 305.0, 310.0), **core, **horizon)
    assert got_A == pytest.approx(-strength_A, abs=STEP_A)


@pytest.mark.parametrize(
    ("estimate_K", "horizon", "hottest_K"),
    [
        (305.0, {}, 314.0),
        (305.0, {"surface_K": 1.0}, 315.0),
        (330.0, {"surface_per_core": 0.25}, 316.25),
    ],
)
def test_at_the_cores_limit_no_more_heat_is_allowed_than_flows_to_the_hottest_surface(
    estimate_K, horizon, hottest_K
):
    """A core that may be hotter than its limit warms the surface as one at the limit does."""
    rig = pack_of(323.0, 323.0)
    k = rig.core.calibration.rcbf
    left = k.a1_per_s * (323.0 - hottest_K) - k.core_uncertainty_K_per_s - k.core_margin_K_per_s
    strength_A = max(np.roots([k.a3_K_per_A2s, abs(k.a2_per_As) * 323.0, -left]))
    assert 1.0 < strength_A < -STRONGEST_A
    got_A = allowed_A(rig, (314.0, estimate_K, 300.0), **horizon)
    assert got_A == pytest.approx(-strength_A, abs=STEP_A)
