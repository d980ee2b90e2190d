"""In a charge with sensor noise the estimate stays in its domain and within its bound."""

import numpy as np
import pytest

from bms.cell import CellState, Disturbance, integrate_step
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset, one_cell_preset_names

PERIOD_S = 0.5
CHARGES = 20


def barrier_current_A(preset, core_K, surface_K):
    """Largest charging current with dTc/dt <= (Tc_max - Tc)/(Rc Cc), found by bisection."""
    cell = preset.cell
    low = np.full_like(core_K, preset.limits.reference_current_A)
    high = np.zeros_like(core_K)
    limit_K = preset.limits.max_core_temperature_K

    def allowed(current_A):
        heat_W = current_A * (
            cell.ohmic_resistance_ohm * current_A - cell.entropic_coefficient_V_per_K * core_K
        )
        return heat_W <= (limit_K - surface_K) / cell.core_resistance_K_per_W

    full = allowed(low)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = np.where(allowed(middle), low, middle), np.where(allowed(middle), middle, high)
    return np.where(full, preset.limits.reference_current_A, high)


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_10c_charge_from_the_initial_state_to_full(name):
    preset, model = load_preset(name), load_shipped_model(name)
    rng = np.random.default_rng(4)
    channels = [getattr(preset.sensors, channel) for channel in model.network.input_names]
    bounds = np.array([channel.error_bound for channel in channels])
    start, strength = preset.initial, 5e-4
    start_K = np.full(CHARGES, start.temperature_K)
    state = CellState(np.full(CHARGES, start.soc), start_K, start_K, start_K)
    current_A = np.zeros(CHARGES)
    worst_K = 0.0
    while state.soc.min() < preset.limits.completion_soc:
        truth = np.stack(
            [
                current_A,
                np.full(CHARGES, start.cooling_power_W),
                state.surface_temperature_K,
                state.coolant_temperature_K,
            ],
            axis=1,
        )
        readings = truth + bounds * rng.uniform(-1.0, 1.0, truth.shape)
        estimate_K, in_domain = model.network.evaluate(readings)
        assert in_domain.all()
        worst_K = max(worst_K, np.max(np.abs(estimate_K - state.core_temperature_K)))
        current_A = barrier_current_A(preset, state.core_temperature_K, state.surface_temperature_K)
        bang_bang = strength * rng.choice([-1.0, 1.0], (3, CHARGES))
        state = integrate_step(
            preset.cell,
            state,
            current_A,
            start.cooling_power_W,
            PERIOD_S,
            Disturbance(0.0, *bang_bang),
        )
    assert worst_K <= model.error_bound_K
