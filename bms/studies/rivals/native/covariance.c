#include "covariance.h"

static void add_noise_and_mirror(const noise_t *noise, covariance_t *covariance)
{
    for (uint32_t row = 0u; row < noise->states; row++) {
        for (uint32_t column = row; column < noise->states; column++) {
            covariance->value[row][column] += noise->process_noise[row][column];
            covariance->value[column][row] = covariance->value[row][column];
        }
    }
}

void covariance_predict(const noise_t *noise, covariance_t *covariance,
                        const float transition[COVARIANCE_MOVING][COVARIANCE_MAX_STATES])
{
    const uint32_t states = noise->states;
    float product[COVARIANCE_MOVING][COVARIANCE_MAX_STATES] = { { 0.0f } };
    for (uint32_t row = 0u; row < COVARIANCE_MOVING; row++) {
        for (uint32_t column = 0u; column < states; column++) {
            for (uint32_t k = 0u; k < states; k++) {
                product[row][column] += transition[row][k] * covariance->value[k][column];
            }
        }
    }
    for (uint32_t row = 0u; row < COVARIANCE_MOVING; row++) {
        for (uint32_t column = row; column < COVARIANCE_MOVING; column++) {
            float sum = 0.0f;
            for (uint32_t k = 0u; k < states; k++) {
                sum += product[row][k] * transition[column][k];
            }
            covariance->value[row][column] = sum;
        }
        for (uint32_t column = COVARIANCE_MOVING; column < states; column++) {
            covariance->value[row][column] = product[row][column];
        }
    }
    add_noise_and_mirror(noise, covariance);
}

void covariance_correct(const noise_t *noise, covariance_t *covariance,
                        float gain[COVARIANCE_MAX_STATES])
{
    const uint32_t states = noise->states;
    float measured[COVARIANCE_MAX_STATES] = { 0.0f };
    for (uint32_t i = 0u; i < states; i++) {
        measured[i] = covariance->value[COVARIANCE_MEASURED][i];
    }
    const float weight = 1.0f / (measured[COVARIANCE_MEASURED] + noise->reading_variance);
    for (uint32_t row = 0u; row < states; row++) {
        gain[row] = measured[row] * weight;
        for (uint32_t column = row; column < states; column++) {
            covariance->value[row][column] -= gain[row] * measured[column];
            covariance->value[column][row] = covariance->value[row][column];
        }
    }
}
