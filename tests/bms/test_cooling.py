"""A plant whose surface is cooled by free convection, beside an integrator of its own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import CellState, rates
from bms.data.cooling import Cooling
from bms.data.profiles import SAMPLE_PERIOD_S, draw_profiles
from bms.data.simulate import simulate
from bms.presets import load_preset

PRESET = load_preset("paper_calibrated")
CELL = PRESET.cell


def surface_at(*temperatures_K: float) -> CellState:
    surface_K = np.array(temperatures_K)
    return CellState(0.5, surface_K, surface_K, np.full(surface_K.shape, 300.0))


def test_free_convection_is_the_cell_s_own_cooling_at_5_kelvin() -> None:
    """Above it more flows, below it less, and against the difference nothing does."""
    state = surface_at(290.0, 295.0, 299.0, 300.0, 301.0, 305.0, 310.0)
    linear_W = (state.surface_temperature_K - 300.0) / CELL.surface_resistance_K_per_W
    share = np.array([2.0**0.25, 1.0, 0.2**0.25, 1.0, 0.2**0.25, 1.0, 2.0**0.25])
    excess_W = Cooling.FREE_CONVECTION.excess_W(CELL, state)
    assert excess_W == pytest.approx((share - 1.0) * linear_W)
    assert np.all(Cooling.LINEAR.excess_W(CELL, state) == 0.0)


class Still(np.random.Generator):
    """No process noise."""

    def standard_normal(self, size=None):  # type: ignore[override, no-untyped-def]
        return np.zeros(size)


def core_by_scipy_K(current_A: float, cooling_W: float, start_K: float, time_s: np.ndarray):
    conductance_W_per_K = 1.0 / CELL.surface_resistance_K_per_W

    def derivative(_: float, y: np.ndarray) -> list[float]:
        rate = rates(CELL, CellState(*y), current_A, cooling_W)
        difference_K = y[2] - y[3]
        factor = (abs(difference_K) / 5.0) ** 0.25 - 1.0
        excess_W = conductance_W_per_K * factor * difference_K
        return [
            rate.soc,
            rate.core_temperature_K,
            rate.surface_temperature_K - excess_W / CELL.surface_heat_capacity_J_per_K,
            rate.coolant_temperature_K + excess_W / CELL.coolant_heat_capacity_J_per_K,
        ]

    span = (0.0, float(time_s[-1]))
    start = [0.1, start_K, start_K, start_K]
    found = solve_ivp(derivative, span, start, "LSODA", time_s, rtol=1e-9, atol=1e-9)
    return found.y[1]


def test_a_profile_is_that_of_an_independent_integrator() -> None:
    """Within what the flow changes in a quarter of a second, for which it is held."""
    still = Still(np.random.PCG64(0))
    drawn = draw_profiles(PRESET, "constant", 1, np.random.default_rng(3))
    wanted_A = np.full_like(drawn.wanted_current_A, -12.0)
    profile = replace(
        drawn,
        wanted_current_A=wanted_A,
        cooling_power_W=np.array([0.5]),
        initial_soc=np.array([0.1]),
        initial_temperature_K=np.array([298.0]),
        core_limit_K=np.array([400.0]),
    )
    samples = simulate(PRESET, profile, still, cooling=Cooling.FREE_CONVECTION)
    core_K = core_by_scipy_K(-12.0, 0.5, 298.0, samples.time_s)
    assert len(core_K) > 100 / SAMPLE_PERIOD_S
    assert samples.core_temperature_K == pytest.approx(core_K, abs=0.01)
    linear = simulate(PRESET, profile, still)
    shorter = min(len(linear.core_temperature_K), len(core_K))
    assert np.abs(linear.core_temperature_K[:shorter] - core_K[:shorter]).max() > 0.05
