/* Covariance of a filter that measures its second state.
 *
 * The first two states move; a third, when there is one, is a constant that drifts at random.
 */
#ifndef COVARIANCE_H
#define COVARIANCE_H

#include <stdint.h>

#define COVARIANCE_MAX_STATES 3
#define COVARIANCE_MOVING 2
#define COVARIANCE_MEASURED 1

typedef struct {
    uint32_t states;
    float start[COVARIANCE_MAX_STATES][COVARIANCE_MAX_STATES];
    float process_noise[COVARIANCE_MAX_STATES][COVARIANCE_MAX_STATES];
    float reading_variance;
} noise_t;

typedef struct {
    float value[COVARIANCE_MAX_STATES][COVARIANCE_MAX_STATES];
} covariance_t;

/* One period later: F P F' + Q; `transition` has the rows of F of the moving states. */
void covariance_predict(const noise_t *noise, covariance_t *covariance,
                        const float transition[COVARIANCE_MOVING][COVARIANCE_MAX_STATES]);

/* After a reading; `gain` receives the weight of its surprise in each state. */
void covariance_correct(const noise_t *noise, covariance_t *covariance,
                        float gain[COVARIANCE_MAX_STATES]);

#endif
