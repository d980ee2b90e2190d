#include "quadratic.h"

float quadratic_estimate_K(const quadratic_t *quadratic, const float *inputs)
{
    const float *weight_K = quadratic->weights_K;
    float core_K = quadratic->offset_K;
    for (uint32_t i = 0u; i < quadratic->inputs; i++) {
        float slope_K = *weight_K++;
        for (uint32_t j = i; j < quadratic->inputs; j++) {
            slope_K += *weight_K++ * (inputs[j] - quadratic->center[j]);
        }
        core_K += slope_K * (inputs[i] - quadratic->center[i]);
    }
    return core_K;
}
