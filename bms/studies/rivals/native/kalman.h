/* Kalman filters of the core temperature; the surface temperature is what they correct with. */
#ifndef KALMAN_H
#define KALMAN_H

#include "covariance.h"
#include "thermal.h"

/* Gain in steady state, computed beforehand. */
typedef struct {
    thermal_t cell;
    float gain[2];
} steady_kalman_t;

/* Covariance computed with every sample: two states, or three when the resistance is unknown. */
typedef struct {
    thermal_t cell;
    noise_t noise;
} kalman_t;

/* `resistance_ratio` is the estimated resistance over the one in the model. */
typedef struct {
    thermal_state_t thermal;
    covariance_t covariance;
    float resistance_ratio;
} kalman_state_t;

/* State at the first sample. */
kalman_state_t kalman_start(const kalman_t *kalman, const float *inputs);

/* Core temperature in K one period later. */
float steady_kalman_step_K(const steady_kalman_t *kalman, thermal_state_t *state,
                           const float *inputs);
float kalman_step_K(const kalman_t *kalman, kalman_state_t *state, const float *inputs);

/* The same for the extended filter, whose third state is the resistance ratio. */
float extended_kalman_step_K(const kalman_t *kalman, kalman_state_t *state, const float *inputs);

#endif
