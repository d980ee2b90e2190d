#include "mlp.h"

#include <math.h>

float mlp_estimate_K(const mlp_t *mlp, const float *inputs)
{
    float nodes[MLP_MAX_WIDTH] = { 0.0f };
    for (uint32_t i = 0u; i < mlp->width[0]; i++) {
        nodes[i] = (inputs[i] - mlp->center[i]) * mlp->scale[i];
    }
    const float *weights = mlp->weights;
    for (uint32_t layer = 0u; layer < mlp->layers; layer++) {
        float sums[MLP_MAX_WIDTH];
        for (uint32_t to = 0u; to < mlp->width[layer + 1u]; to++) {
            float sum = *weights++;
            for (uint32_t from = 0u; from < mlp->width[layer]; from++) {
                sum += *weights++ * nodes[from];
            }
            sums[to] = sum;
        }
        for (uint32_t i = 0u; i < mlp->width[layer + 1u]; i++) {
            nodes[i] = (layer + 1u < mlp->layers) ? tanhf(sums[i]) : sums[i];
        }
    }
    return mlp->output_center_K + mlp->output_half_range_K * nodes[0];
}
