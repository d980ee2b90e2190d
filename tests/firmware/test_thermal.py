"""The surface cannot be colder than the heat allows: the prediction in C and its error bound."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from bms.barrier.surface_prediction import surface_prediction
from bms.bus_signals import BusQuantisation
from bms.cell import CellState, Disturbance, integrate_step
from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.presets import Preset, load_preset

PRESETS = ("lin2014", "paper_calibrated")
SUB_STEPS = 10


class Prediction:
    """The firmware's prediction with the constants of a preset."""

    def __init__(self, preset: Preset) -> None:
        self._ecu = Ecu(preset)
        self.constants = ffi.addressof(self._ecu._state.calibration.thermal)
        self._state = ffi.new("thermal_t *")

    def step(self, current_A: float, surface_K: float, coolant_K: float) -> float:
        lib.thermal_step(self._state, self.constants, current_A, surface_K, coolant_K)
        return float(lib.thermal_coldest_surface_K(self._state, self.constants))


def charge(preset: Preset, seconds: float, seed: int) -> Any:
    """Currents of a charge that also pauses, one for each period."""
    rng = np.random.default_rng(seed)
    periods = round(seconds / preset.timing.sampling_period_s)
    held = np.repeat(rng.uniform(-23.0, 0.0, periods // 300 + 1), 300)[:periods]
    return np.where(np.arange(periods) < 1500, -23.0, held)


def excess_range_K(preset: Preset, disturbance: Disturbance, errors: np.ndarray) -> np.ndarray:
    """Least and largest (2, N) of how far the surface reads above the coldest possible, from rest.

    The disturbance's parts and the sensors' errors of current, surface and coolant (3, N) are kept.
    """
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    current_error_A, surface_error_K, coolant_error_K = errors
    start_K = np.full(errors.shape[1], preset.initial.temperature_K)
    state = CellState(0.05 * np.ones_like(start_K), start_K, start_K, start_K)
    predictions = [Prediction(preset) for _ in start_K]
    smallest, largest = np.full_like(start_K, np.inf), np.full_like(start_K, -np.inf)
    before_A = 0.0
    for current_A in [0.0, *charge(preset, 600.0, seed=4).tolist()]:
        coldest_K = np.array(
            [
                prediction.step(*readings)
                for prediction, *readings in zip(
                    predictions,
                    (before_A + current_error_A).tolist(),
                    (state.surface_temperature_K + surface_error_K).tolist(),
                    (state.coolant_temperature_K + coolant_error_K).tolist(),
                )
            ]
        )
        excess_K = state.surface_temperature_K + surface_error_K - coldest_K
        smallest, largest = np.minimum(smallest, excess_K), np.maximum(largest, excess_K)
        for _ in range(SUB_STEPS):
            state = integrate_step(preset.cell, state, current_A, 0.3, step_s, disturbance)
        before_A = current_A
    return np.stack([smallest, largest])


@pytest.mark.parametrize("name", PRESETS)
def test_before_the_first_reading_nothing_is_too_cold(name: str) -> None:
    prediction = Prediction(load_preset(name))
    fresh = ffi.new("thermal_t *")
    assert lib.thermal_coldest_surface_K(fresh, prediction.constants) < -1e30


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
def test_undisturbed_prediction_is_the_surface_itself(name: str) -> None:
    preset = load_preset(name)
    bound_K = surface_prediction(preset.cell, preset).error_bound_K
    zero = np.zeros(1)
    excess_K = excess_range_K(preset, Disturbance(0.0, zero, zero, zero), np.zeros((3, 1)))
    assert excess_K == pytest.approx(np.full((2, 1), bound_K), abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
def test_nothing_within_the_modelled_uncertainty_reads_as_a_deficit(name: str) -> None:
    """All corners of disturbance and sensor errors at once, from a start that was misread, too."""
    preset = load_preset(name)
    bounds, sensors, bus = preset.uncertainty, preset.sensors, BusQuantisation()
    signs = np.array(list(product((-1.0, 1.0), repeat=5))).T
    disturbance = Disturbance(
        0.0, signs[0] * bounds.core_K_per_s, signs[1] * bounds.surface_K_per_s, 0.0 * signs[0]
    )
    worst = [
        sensors.current_A.error_bound + bus.current_A,
        sensors.surface_temperature_K.error_bound + bus.surface_temperature_K,
        sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K,
    ]
    excess_K = excess_range_K(preset, disturbance, signs[2:] * np.array(worst)[:, None])[0]
    assert excess_K.min() >= 0.0
    # These histories come near the bound, so it is not much wider than it has to be.
    assert excess_K.min() < 0.6 * surface_prediction(preset.cell, preset).error_bound_K


def test_a_period_is_the_linear_model_of_its_constants() -> None:
    """Every constant counts, in its own place; the heat is that of the core, not of the surface."""
    transition = np.array([[0.7, 0.2], [0.3, 0.4]])
    gain_heat, gain_coolant = np.array([0.013, 0.0017]), np.array([0.1, 0.3])
    ohm, entropic = 0.05, 3e-3
    constants = ffi.new(
        "thermal_constants_t *",
        {
            "transition": transition.ravel().tolist(),
            "gain_K_per_W": gain_heat.tolist(),
            "gain_coolant": gain_coolant.tolist(),
            "ohmic_resistance_ohm": ohm,
            "entropic_coefficient_V_per_K": entropic,
            "error_bound_K": 0.75,
        },
    )
    state = ffi.new("thermal_t *")
    lib.thermal_step(state, constants, -20.0, 290.0, 280.0)
    assert lib.thermal_predicted_surface_K(state) == 290.0, "what came before is not known"
    rise = np.zeros(2)
    for current_A, coolant_K in [(-20.0, 290.0), (0.0, 297.0), (15.0, 280.0), (-8.0, 301.0)]:
        heat_W = ohm * current_A**2 - entropic * (290.0 + rise[0]) * current_A
        rise = transition @ rise + gain_heat * heat_W + gain_coolant * (coolant_K - 290.0)
        lib.thermal_step(state, constants, current_A, 333.0, coolant_K)
        predicted_K = lib.thermal_predicted_surface_K(state)
        assert predicted_K == pytest.approx(290.0 + rise[1], abs=1e-3)
        assert state.core_rise_K == pytest.approx(rise[0], abs=1e-3)
        assert lib.thermal_coldest_surface_K(state, constants) == predicted_K - 0.75
    lib.thermal_reset(state)
    assert lib.thermal_predicted_surface_K(state) < -1e30
