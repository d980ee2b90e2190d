"""The Kalman filters in float32 C against plain ones in double precision."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.linalg import expm

from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.filters import ExtendedKalman, FullKalman, SteadyKalman
from bms.studies.rivals.tuning import FittedRows, tuned_filter, tuned_noise
from tests.bms.rival_samples import CELL, NOISE, PERIOD_S, charge, noisy_sequences

MEASURED = np.array([0.0, 1.0])
FLOAT32_K = 2e-3


def thermal_matrices():
    """Transition, effects of heat and coolant, and of the two rates, by one matrix exponential."""
    r_c, r_s = CELL.core_resistance_K_per_W, CELL.surface_resistance_K_per_W
    c_c, c_s = CELL.core_heat_capacity_J_per_K, CELL.surface_heat_capacity_J_per_K
    a = np.array([[-1 / (r_c * c_c), 1 / (r_c * c_c)], [1 / (r_c * c_s), 0.0]])
    a[1, 1] = -1 / (r_c * c_s) - 1 / (r_s * c_s)
    b = np.array([[1 / c_c, 0.0, 1.0, 0.0], [0.0, 1 / (r_s * c_s), 0.0, 1.0]])
    whole = expm(PERIOD_S * np.block([[a, b], [np.zeros((4, 6))]]))
    return whole[:2, :2], whole[:2, 2], whole[:2, 3], whole[:2, 4:]


F, HEAT, COOLANT, RATES = thermal_matrices()
Q = RATES @ np.diag([NOISE.core_K_per_s**2, NOISE.surface_K_per_s**2]) @ RATES.T


def advanced(state, resistance_ohm, before, after):
    """The two temperatures a period later; the current is that of the sample before."""
    current_A = before[0]
    heat_W = (
        resistance_ohm * current_A**2 - CELL.entropic_coefficient_V_per_K * current_A * state[0]
    )
    return F @ state[:2] + HEAT * heat_W + COOLANT * 0.5 * (before[3] + after[3])


def corrected(state, covariance, reading_K):
    h = np.eye(len(state))[1]
    gain = covariance @ h / (h @ covariance @ h + NOISE.reading_K**2)
    joseph = np.eye(len(state)) - np.outer(gain, h)
    covariance = joseph @ covariance @ joseph.T + np.outer(gain, gain) * NOISE.reading_K**2
    return state + gain * (reading_K - state[1]), covariance, gain


def start_covariance():
    shared = np.full((2, 2), NOISE.reading_K**2)
    return shared + np.diag([NOISE.start_K**2, 0.0])


def linear_filter(inputs, steady):
    state, covariance = np.full(2, inputs[0, 2]), start_covariance()
    if steady:
        for _ in range(2000):
            gain = corrected(state, covariance, 0.0)[2]
            covariance = F @ corrected(state, covariance, 0.0)[1] @ F.T + Q
    cores_K = [state[0]]
    for before, after in itertools.pairwise(inputs):
        state = advanced(state, CELL.ohmic_resistance_ohm, before, after)
        if steady:
            state = state + gain * (after[2] - state[1])
        else:
            covariance = F @ covariance @ F.T + Q
            state, covariance, _ = corrected(state, covariance, after[2])
        cores_K.append(state[0])
    return cores_K


def extended_filter(inputs, start_factor):
    nominal_ohm = start_factor * CELL.ohmic_resistance_ohm
    state = np.array([inputs[0, 2], inputs[0, 2], 1.0])
    covariance, process = np.zeros((3, 3)), np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = start_covariance(), NOISE.resistance_start**2
    process[:2, :2], process[2, 2] = Q, NOISE.resistance_drift_per_sqrt_s**2 * PERIOD_S

    def step(values, before, after):
        return np.append(advanced(values, nominal_ohm * values[2], before, after), values[2])

    cores_K = [state[0]]
    for before, after in itertools.pairwise(inputs):
        slopes = np.stack(
            [
                (step(state + shift, before, after) - step(state - shift, before, after)) / 2e-4
                for shift in 1e-4 * np.eye(3)
            ],
            axis=1,
        )
        state = step(state, before, after)
        covariance = slopes @ covariance @ slopes.T + process
        state, covariance, _ = corrected(state, covariance, after[2])
        cores_K.append(state[0])
    return cores_K


FILTERS = {
    "steady": (
        SteadyKalman(CELL, NOISE, PERIOD_S, ""),
        lambda inputs: linear_filter(inputs, steady=True),
    ),
    "full": (
        FullKalman(CELL, NOISE, PERIOD_S, ""),
        lambda inputs: linear_filter(inputs, steady=False),
    ),
    "extended": (
        ExtendedKalman(CELL, NOISE, PERIOD_S, "", start_factor=1.3),
        lambda inputs: extended_filter(inputs, 1.3),
    ),
}


def run(estimator, data):
    return estimator.estimate(data.of_columns(estimator.columns), data.starts)


@pytest.mark.parametrize("name", FILTERS)
def test_c_filter_gives_what_a_plain_filter_gives_profile_by_profile(name):
    estimator, oracle = FILTERS[name]
    data = noisy_sequences()

    estimate_K = run(estimator, data)

    inputs = data.inputs.astype(np.float64)
    expected_K = np.concatenate(
        [oracle(inputs[begin:end]) for begin, end in zip(data.starts, data.starts[1:])]
    )
    assert np.abs(estimate_K - expected_K).max() < FLOAT32_K
    assert np.ptp(estimate_K - inputs[:, 2]) > 1.0, "the core must differ from the surface"


@pytest.mark.parametrize("name", ["steady", "full"])
def test_filter_follows_a_cell_that_it_knows(name):
    data = Sequences.of(charge())

    error_K = run(FILTERS[name][0], data) - data.core_temperature_K

    assert np.abs(error_K).max() < FLOAT32_K


def test_extended_filter_learns_a_resistance_that_the_linear_one_has_wrong():
    data = Sequences.of(charge(rows=1500))
    wrong = dataclasses.replace(CELL, ohmic_resistance_ohm=1.3 * CELL.ohmic_resistance_ohm)

    learning_K = run(FILTERS["extended"][0], data) - data.core_temperature_K
    stubborn_K = run(FullKalman(wrong, NOISE, PERIOD_S, ""), data) - data.core_temperature_K

    late = slice(1000, None)
    assert np.abs(learning_K[late]).max() < 0.1 * np.abs(stubborn_K[late]).max()


@pytest.mark.long("training")
def test_tuning_finds_a_cell_that_explains_the_fitted_rows_and_those_after_them():
    data = Sequences.of(charge(rows=900))
    fitted = FittedRows(data, np.arange(900) < 600, PERIOD_S)
    other = dataclasses.replace(
        CELL, core_resistance_K_per_W=1.4, ohmic_resistance_ohm=0.02, entropic_coefficient_V_per_K=0
    )

    def rmse_K(cell, noise, rows):
        error_K = run(SteadyKalman(cell, noise, PERIOD_S, ""), data) - data.core_temperature_K
        return np.sqrt(np.mean(error_K[rows] ** 2))

    by_noise = tuned_noise(other, NOISE, fitted)
    wholly = tuned_filter(other, by_noise, fitted)

    assert rmse_K(other, by_noise, fitted.rows) < rmse_K(other, NOISE, fitted.rows)
    assert rmse_K(*wholly, fitted.rows) < 0.2 * rmse_K(other, by_noise, fitted.rows)
    assert rmse_K(*wholly, ~fitted.rows) < 0.2 * rmse_K(other, by_noise, ~fitted.rows)


@pytest.mark.parametrize("name", FILTERS)
def test_a_profile_does_not_depend_on_those_before_it(name):
    estimator, _ = FILTERS[name]
    data = noisy_sequences()
    second = slice(int(data.starts[1]), int(data.starts[2]))

    alone = Sequences(
        data.inputs[second],
        np.array([0, second.stop - second.start], dtype=np.uint32),
        data.core_temperature_K[second],
        data.time_s[second],
    )

    assert np.array_equal(run(estimator, alone), run(estimator, data)[second])
