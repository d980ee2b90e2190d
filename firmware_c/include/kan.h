/* Kolmogorov-Arnold network: core temperature from measured quantities.
 *
 * Every edge function is a table of polynomials, one for each grid cell, in the distance from the
 * cell's middle. Only + - * and comparisons are used, so that all targets give the same bits.
 */
#ifndef KAN_H
#define KAN_H

#include <stdbool.h>
#include <stdint.h>

#define KAN_MAX_LAYERS 3
#define KAN_MAX_WIDTH 8
#define KAN_MAX_KNOTS 192
#define KAN_MAX_COEFFICIENTS 512
#define KAN_CELL_COEFFICIENTS 8

/* Edges are stored layer by layer, output by output, input by input; an edge has cells + 1 knots
 * and cells * KAN_CELL_COEFFICIENTS coefficients, constant term first. */
typedef struct {
    uint32_t layers;
    uint32_t cells;
    uint32_t width[4];
    float input_center[8];
    float input_scale[8];
    float output_center_K;
    float output_half_range_K;
    float knots[KAN_MAX_KNOTS];
    float coefficients[KAN_MAX_COEFFICIENTS];
} kan_model_t;

typedef struct {
    float core_temperature_K;
    bool in_domain;
} kan_estimate_t;

/* True when sizes fit the maxima, all numbers are finite and all knots rise. */
bool kan_model_is_valid(const kan_model_t *model);

/* Estimate for width[0] inputs. Inputs outside the trained domain (or not finite) are clamped and
 * clear in_domain. The model must be valid. */
kan_estimate_t kan_evaluate(const kan_model_t *model, const float *inputs);

#endif
