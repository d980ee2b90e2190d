#include "kalman.h"

/* Corrects the temperatures by the gain; returns what was measured more than expected, in K. */
static float correct_K(thermal_state_t *state, const float *gain, const float *inputs)
{
    const float surprise_K = inputs[INPUT_SURFACE] - state->surface_K;
    state->core_K += gain[0] * surprise_K;
    state->surface_K += gain[1] * surprise_K;
    return surprise_K;
}

kalman_state_t kalman_start(const kalman_t *kalman, const float *inputs)
{
    kalman_state_t state = { thermal_rest(inputs), { { { 0.0f } } }, 1.0f };
    for (uint32_t row = 0u; row < kalman->noise.states; row++) {
        for (uint32_t column = 0u; column < kalman->noise.states; column++) {
            state.covariance.value[row][column] = kalman->noise.start[row][column];
        }
    }
    return state;
}

float steady_kalman_step_K(const steady_kalman_t *kalman, thermal_state_t *state,
                           const float *inputs)
{
    const thermal_t *cell = &kalman->cell;
    thermal_advance(cell, state, thermal_heat_W(cell, state, cell->ohmic_resistance_ohm), inputs);
    (void)correct_K(state, kalman->gain, inputs);
    return state->core_K;
}

float kalman_step_K(const kalman_t *kalman, kalman_state_t *state, const float *inputs)
{
    const thermal_t *cell = &kalman->cell;
    const float transition[COVARIANCE_MOVING][COVARIANCE_MAX_STATES] = {
        { cell->transition[0][0], cell->transition[0][1], 0.0f },
        { cell->transition[1][0], cell->transition[1][1], 0.0f },
    };
    float gain[COVARIANCE_MAX_STATES] = { 0.0f };
    thermal_advance(cell, &state->thermal,
                    thermal_heat_W(cell, &state->thermal, cell->ohmic_resistance_ohm), inputs);
    covariance_predict(&kalman->noise, &state->covariance, transition);
    covariance_correct(&kalman->noise, &state->covariance, gain);
    (void)correct_K(&state->thermal, gain, inputs);
    return state->thermal.core_K;
}

float extended_kalman_step_K(const kalman_t *kalman, kalman_state_t *state, const float *inputs)
{
    const thermal_t *cell = &kalman->cell;
    const float current_A = state->thermal.current_A;
    const float resistance_ohm = cell->ohmic_resistance_ohm * state->resistance_ratio;
    /* Slopes of the heat over core temperature and resistance ratio. */
    const float per_core_W = -cell->entropic_coefficient_V_per_K * current_A;
    const float per_ratio_W = cell->ohmic_resistance_ohm * current_A * current_A;
    const float *heat_gain = cell->heat_gain_K_per_W;
    const float transition[COVARIANCE_MOVING][COVARIANCE_MAX_STATES] = {
        { cell->transition[0][0] + heat_gain[0] * per_core_W, cell->transition[0][1],
          heat_gain[0] * per_ratio_W },
        { cell->transition[1][0] + heat_gain[1] * per_core_W, cell->transition[1][1],
          heat_gain[1] * per_ratio_W },
    };
    float gain[COVARIANCE_MAX_STATES] = { 0.0f };
    thermal_advance(cell, &state->thermal, thermal_heat_W(cell, &state->thermal, resistance_ohm),
                    inputs);
    covariance_predict(&kalman->noise, &state->covariance, transition);
    covariance_correct(&kalman->noise, &state->covariance, gain);
    state->resistance_ratio += gain[2] * correct_K(&state->thermal, gain, inputs);
    return state->thermal.core_K;
}
