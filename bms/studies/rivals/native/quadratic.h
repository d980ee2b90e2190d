/* Quadratic map of the inputs to the core temperature. */
#ifndef QUADRATIC_H
#define QUADRATIC_H

#include <stdint.h>

/* center has one number for each input. The weights are, for each input, its own and then those of
 * its products with itself and with every later input, about the center; offset_K is the value
 * there. */
typedef struct {
    uint32_t inputs;
    const float *center;
    const float *weights_K;
    float offset_K;
} quadratic_t;

/* Core temperature in K; `inputs` holds quadratic->inputs numbers. */
float quadratic_estimate_K(const quadratic_t *quadratic, const float *inputs);

#endif
