/* Kolmogorov-Arnold network: core temperature from measured quantities.
 *
 * Every edge function is a table of polynomials, one for each grid cell, in the distance from the
 * cell's middle. Only + - * and comparisons are used, so that all targets give the same bits.
 */
#ifndef KAN_H
#define KAN_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define KAN_MAX_LAYERS 3
#define KAN_MAX_WIDTH 8 /* nodes of a layer, inputs too */
#define KAN_MAX_KNOTS 128
#define KAN_MAX_COEFFICIENTS 512
#define KAN_CELL_COEFFICIENTS 8
#define KAN_MEASURED_INPUTS 4 /* the first inputs; lagged ones follow */
#define KAN_MAX_LAGS 4
#define KAN_MAX_DIRECTIONS 8

/* What a lagged input remembers. */
typedef enum { KAN_CURRENT_SQUARED = 0, KAN_SURFACE_TEMPERATURE_RISE = 1 } kan_quantity_t;

/* A lagged input: y <- decay y + gain times the current squared, or the surface temperature's
 * change, of one period. */
typedef struct {
    uint32_t quantity; /* kan_quantity_t */
    float decay;
    float gain;
} kan_lag_t;

/* Training data lie at low <= component . normalised inputs <= high. */
typedef struct {
    float component[KAN_MAX_WIDTH];
    float low;
    float high;
} kan_direction_t;

/* Edges are stored layer by layer, output by output, input by input; an edge has cells + 1 knots,
 * and then for each cell KAN_CELL_COEFFICIENTS, constant term first. What follows the last edge is
 * never read, and need not exist where the model stands. */
typedef struct {
    uint32_t layers;
    uint32_t cells;                     /* of every edge */
    uint32_t width[KAN_MAX_LAYERS + 1]; /* nodes: inputs first, the one output last */
    uint32_t lags;                      /* how many of the inputs, the last ones, are lagged */
    uint32_t settling_periods;
    uint32_t directions;
    uint32_t spans_reach; /* 1 where the first layer's knots span what inputs reach */
    kan_lag_t lag[KAN_MAX_LAGS];
    kan_direction_t direction[KAN_MAX_DIRECTIONS];
    float input_center[KAN_MAX_WIDTH];
    float input_scale[KAN_MAX_WIDTH];
    float input_reach; /* normalised inputs act up to this; beyond 1 they are flagged */
    float output_center_K;
    float output_half_range_K;
    float tables[KAN_MAX_KNOTS + KAN_MAX_COEFFICIENTS];
} kan_model_t;

typedef struct {
    float core_temperature_K;
    bool in_domain;
} kan_estimate_t;

/* True when sizes fit the maxima, all numbers are finite, all knots rise, and those of the first
 * layer span what inputs reach where they are said to. */
bool kan_model_is_valid(const kan_model_t *model);

/* Bytes of a model up to the end of its last edge; 0 where its sizes do not fit the maxima. */
uint32_t kan_model_length(const kan_model_t *model);

/* Edge function number `edge` at x, which is clamped to its knots; beyond them (or for NaN) clears
 * in_domain. The model must be valid. */
float kan_edge_value(const kan_model_t *model, uint32_t edge, float x, bool *in_domain);

/* Estimate for width[0] inputs. Inputs outside the trained box or the directions' slabs (or not
 * finite) clear in_domain; beyond input_reach they are clamped. The model must be valid. */
kan_estimate_t kan_evaluate(const kan_model_t *model, const float *inputs);

#ifdef __cplusplus
}
#endif

#endif
