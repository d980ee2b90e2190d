/* Multilayer perceptron: tanh in the hidden layers, a linear last one with a single node. */
#ifndef MLP_H
#define MLP_H

#include <stdint.h>

#define MLP_MAX_WIDTH 64

/* width has layers + 1 entries of at most MLP_MAX_WIDTH; weights run layer by layer and node by
 * node, the bias of a node first. Inputs are scaled to (x - center) * scale. */
typedef struct {
    uint32_t layers;
    const uint32_t *width;
    const float *center;
    const float *scale;
    const float *weights;
    float output_center_K;
    float output_half_range_K;
} mlp_t;

/* Core temperature in K; `inputs` holds mlp->width[0] numbers. */
float mlp_estimate_K(const mlp_t *mlp, const float *inputs);

#endif
