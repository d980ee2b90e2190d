/* Linear map of the inputs to the core temperature. */
#ifndef LINEAR_H
#define LINEAR_H

#include <stdint.h>

/* center and weights_K have one number for each input; offset_K is the value at the center. */
typedef struct {
    uint32_t inputs;
    const float *center;
    const float *weights_K;
    float offset_K;
} linear_t;

/* Core temperature in K; `inputs` holds linear->inputs numbers. */
float linear_estimate_K(const linear_t *linear, const float *inputs);

#endif
