#include "linear.h"

float linear_estimate_K(const linear_t *linear, const float *inputs)
{
    float core_K = linear->offset_K;
    for (uint32_t i = 0u; i < linear->inputs; i++) {
        core_K += linear->weights_K[i] * (inputs[i] - linear->center[i]);
    }
    return core_K;
}
