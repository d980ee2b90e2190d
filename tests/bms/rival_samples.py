"""Small data sets and settings that the tests of the rivals start from."""

import numpy as np

from bms.cell import CellState, integrate_step
from bms.data.simulate import Samples, joined
from bms.presets import load_preset
from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.thermal import FilterNoise

CELL = load_preset("lin2014").cell
PERIOD_S = 1.1
NOISE = FilterNoise(
    core_K_per_s=2e-3,
    surface_K_per_s=3e-3,
    reading_K=0.02,
    start_K=0.3,
    resistance_start=0.2,
    resistance_drift_per_sqrt_s=1e-3,
)


def charge(rows=400, seed=0, cell=CELL, start_K=300.0):
    """A made-up charge from rest: the coolant stays, the current changes every 40 samples."""
    rng = np.random.default_rng(seed)
    state = CellState(0.1, start_K, start_K, start_K)
    inputs, core_K = [], []
    for row in range(rows):
        if row % 40 == 0:
            current_A = rng.uniform(-20.0, 0.0)
        # The cooling takes what the surface gives, so that the coolant keeps its temperature.
        cooling_W = (
            state.surface_temperature_K - state.coolant_temperature_K
        ) / cell.surface_resistance_K_per_W
        inputs.append([current_A, cooling_W, *state[2:]])
        core_K.append(state.core_temperature_K)
        for _ in range(22):
            state = integrate_step(cell, state, current_A, cooling_W, PERIOD_S / 22)
            state = CellState(*state[:3], start_K)
    return Samples(
        np.array(inputs), np.array(core_K), np.zeros(rows, np.int64), PERIOD_S * np.arange(rows)
    )


def noisy_sequences(seed=5):
    """Three charges with noise on all that is measured, of different lengths and temperatures."""
    rng = np.random.default_rng(seed)
    samples = joined(
        charge(rows, seed, start_K=start_K)
        for rows, seed, start_K in ((250, 1, 290.0), (120, 2, 300.0), (1, 3, 310.0))
    )
    samples.inputs[:, [0, 2, 3]] += 0.02 * rng.standard_normal((len(samples.inputs), 3))
    return Sequences.of(samples)
