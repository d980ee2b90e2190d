#include "rows.h"

void linear_rows(const linear_t *linear, const float *inputs, uint32_t rows, float *core_K)
{
    for (uint32_t i = 0u; i < rows; i++) {
        core_K[i] = linear_estimate_K(linear, &inputs[i * linear->inputs]);
    }
}

void quadratic_rows(const quadratic_t *quadratic, const float *inputs, uint32_t rows,
                    float *core_K)
{
    for (uint32_t i = 0u; i < rows; i++) {
        core_K[i] = quadratic_estimate_K(quadratic, &inputs[i * quadratic->inputs]);
    }
}

void mlp_rows(const mlp_t *mlp, const float *inputs, uint32_t rows, float *core_K)
{
    for (uint32_t i = 0u; i < rows; i++) {
        core_K[i] = mlp_estimate_K(mlp, &inputs[i * mlp->width[0]]);
    }
}

void steady_kalman_rows(const steady_kalman_t *kalman, const float *inputs,
                        const uint32_t *starts, uint32_t profiles, float *core_K)
{
    for (uint32_t profile = 0u; profile < profiles; profile++) {
        thermal_state_t state = thermal_rest(&inputs[starts[profile] * INPUTS]);
        core_K[starts[profile]] = state.core_K;
        for (uint32_t i = starts[profile] + 1u; i < starts[profile + 1u]; i++) {
            core_K[i] = steady_kalman_step_K(kalman, &state, &inputs[i * INPUTS]);
        }
    }
}

typedef float (*kalman_step_t)(const kalman_t *, kalman_state_t *, const float *);

static void covariance_rows(const kalman_t *kalman, kalman_step_t step_K, const float *inputs,
                            const uint32_t *starts, uint32_t profiles, float *core_K)
{
    for (uint32_t profile = 0u; profile < profiles; profile++) {
        kalman_state_t state = kalman_start(kalman, &inputs[starts[profile] * INPUTS]);
        core_K[starts[profile]] = state.thermal.core_K;
        for (uint32_t i = starts[profile] + 1u; i < starts[profile + 1u]; i++) {
            core_K[i] = step_K(kalman, &state, &inputs[i * INPUTS]);
        }
    }
}

void kalman_rows(const kalman_t *kalman, const float *inputs, const uint32_t *starts,
                 uint32_t profiles, float *core_K)
{
    covariance_rows(kalman, kalman_step_K, inputs, starts, profiles, core_K);
}

void extended_kalman_rows(const kalman_t *kalman, const float *inputs, const uint32_t *starts,
                          uint32_t profiles, float *core_K)
{
    covariance_rows(kalman, extended_kalman_step_K, inputs, starts, profiles, core_K);
}
