#include "kan.h"

#include <math.h>
#include <stddef.h>

#include "numeric.h"

/* An input on a face of the box may come out of the scaling this much outside. */
#define KAN_FACE_TOLERANCE 1e-6f
#define KAN_FACE (1.0f + KAN_FACE_TOLERANCE)

static uint32_t edge_count(const kan_model_t *model)
{
    uint32_t edges = 0u;
    for (uint32_t layer = 0u; layer < model->layers; layer++) {
        edges += model->width[layer] * model->width[layer + 1u];
    }
    return edges;
}

static bool sizes_fit(const kan_model_t *model)
{
    if ((model->layers < 1u) || (model->layers > KAN_MAX_LAYERS) || (model->cells < 1u) ||
        (model->cells >= KAN_MAX_KNOTS)) {
        return false;
    }
    for (uint32_t layer = 0u; layer <= model->layers; layer++) {
        if ((model->width[layer] < 1u) || (model->width[layer] > KAN_MAX_WIDTH)) {
            return false;
        }
    }
    const uint32_t edges = edge_count(model);
    return (model->width[model->layers] == 1u) && (model->lags <= KAN_MAX_LAGS) &&
           (model->directions <= KAN_MAX_DIRECTIONS) &&
           (edges * (model->cells + 1u) <= KAN_MAX_KNOTS) &&
           (edges * model->cells * KAN_CELL_COEFFICIENTS <= KAN_MAX_COEFFICIENTS);
}

/* Numbers in the tables of an edge. */
NUMERIC_INLINE uint32_t edge_numbers(uint32_t cells)
{
    return cells + 1u + cells * KAN_CELL_COEFFICIENTS;
}

/* Where the coefficients of an edge's last cell stand in its tables. */
NUMERIC_INLINE uint32_t last_coefficients(uint32_t cells)
{
    return cells + 1u + (cells - 1u) * KAN_CELL_COEFFICIENTS;
}

uint32_t kan_model_length(const kan_model_t *model)
{
    if (!sizes_fit(model)) {
        return 0u;
    }
    return (uint32_t)(offsetof(kan_model_t, tables) +
                      edge_count(model) * edge_numbers(model->cells) * sizeof model->tables[0]);
}

static bool memory_is_valid(const kan_model_t *model)
{
    bool valid = (model->lags == 0u) || (model->width[0] == KAN_MEASURED_INPUTS + model->lags);
    for (uint32_t i = 0u; i < model->lags; i++) {
        const kan_lag_t *lag = &model->lag[i];
        valid = valid && (lag->quantity <= KAN_SURFACE_TEMPERATURE_RISE) &&
                (lag->decay >= 0.0f) && (lag->decay < 1.0f) && numeric_is_finite(lag->gain);
    }
    return valid;
}

static bool domain_is_valid(const kan_model_t *model)
{
    bool valid = (model->input_reach >= 1.0f) && numeric_is_finite(model->input_reach);
    for (uint32_t i = 0u; i < model->directions; i++) {
        const kan_direction_t *direction = &model->direction[i];
        valid = valid && numeric_all_finite(direction->component, KAN_MAX_WIDTH) &&
                numeric_is_finite(direction->low) && numeric_is_finite(direction->high) &&
                (direction->low < direction->high);
    }
    return valid;
}

bool kan_model_is_valid(const kan_model_t *model)
{
    if (!sizes_fit(model)) {
        return false;
    }
    bool valid = memory_is_valid(model) && domain_is_valid(model) &&
                 numeric_all_finite(model->input_center, model->width[0]) &&
                 numeric_all_finite(model->input_scale, model->width[0]) &&
                 numeric_is_finite(model->output_center_K) &&
                 numeric_is_finite(model->output_half_range_K);
    const uint32_t edges = edge_count(model);
    const uint32_t from_inputs = model->width[0] * model->width[1];
    for (uint32_t edge = 0u; edge < edges; edge++) {
        const float *knots = &model->tables[edge * edge_numbers(model->cells)];
        valid = valid && numeric_rises(knots, model->cells + 1u) &&
                ((model->spans_reach == 0u) || (edge >= from_inputs) ||
                 ((knots[0] <= -model->input_reach) &&
                  (knots[model->cells] >= model->input_reach)));
    }
    return valid && numeric_all_finite(model->tables, edges * edge_numbers(model->cells));
}

typedef char kan_horner_has_all_coefficients[(KAN_CELL_COEFFICIENTS == 8) ? 1 : -1];

/* Value of an edge at x, no less than its first knot and no more than its last. The pointers are
 * those of its last cell; the first knot ends the search. */
NUMERIC_INLINE float value_within(const float *knot, const float *c, float x)
{
    while (x < knot[0]) {
        knot--;
        c -= KAN_CELL_COEFFICIENTS;
    }
    const float d = x - 0.5f * (knot[0] + knot[1]);
    return ((((((c[7] * d + c[6]) * d + c[5]) * d + c[4]) * d + c[3]) * d + c[2]) * d + c[1]) * d +
           c[0];
}

NUMERIC_INLINE float clamped(float first, float last, float x, bool *in_domain)
{
    /* Written so that an argument within the knots takes two comparisons, and NaN the first way. */
    if (!(x >= first)) {
        *in_domain = *in_domain && (first - x <= KAN_FACE_TOLERANCE);
        return first;
    }
    if (!(x <= last)) {
        *in_domain = *in_domain && (x - last <= KAN_FACE_TOLERANCE);
        return last;
    }
    return x;
}

float kan_edge_value(const kan_model_t *model, uint32_t edge, float x, bool *in_domain)
{
    const uint32_t cells = model->cells;
    const float *knots = &model->tables[edge * edge_numbers(cells)];
    return value_within(&knots[cells - 1u], &knots[last_coefficients(cells)],
                        clamped(knots[0], knots[cells], x, in_domain));
}

#define BLOCK 4u

/* False for NaN, which compares with nothing. Inputs come in blocks, of which those beyond the last
 * input are 0. */
NUMERIC_INLINE bool is_in_slabs(const kan_model_t *model, const float *normalised)
{
    const kan_direction_t *direction = model->direction;
    const kan_direction_t *end = &direction[model->directions];
    const bool is_wide = model->width[0] > BLOCK;
    for (; direction < end; direction++) {
        const float *c = direction->component;
        float along = c[0] * normalised[0];
        along += c[1] * normalised[1];
        along += c[2] * normalised[2];
        along += c[3] * normalised[3];
        if (is_wide) {
            along += c[4] * normalised[4];
            along += c[5] * normalised[5];
            along += c[6] * normalised[6];
            along += c[7] * normalised[7];
        }
        if (!((along >= direction->low) && (along <= direction->high))) {
            return false;
        }
    }
    return true;
}

/* Inputs beyond the trained box act no further than the reach, and are flagged. */
static bool clamp_to_reach(const kan_model_t *model, float *nodes)
{
    bool in_domain = true;
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        const float value = nodes[i];
        const float magnitude = fabsf(value);
        if (!(magnitude <= 1.0f)) {
            in_domain = in_domain && (magnitude <= KAN_FACE);
            nodes[i] = numeric_clamp(value, -model->input_reach, model->input_reach);
        }
    }
    return in_domain;
}

/* The tables of an edge's last cell, and the step to those of the next edge. */
typedef struct {
    const float *knot;
    const float *c;
    uint32_t cells;
    uint32_t numbers;
} edge_walk_t;

/* Sum of the edges that lead from all nodes to one; nodes that the knots span need no clamping. */
NUMERIC_INLINE float sum_of_edges(edge_walk_t *walk, const float *nodes, const float *end,
                                  bool is_spanned, bool *in_domain)
{
    const float *knot = walk->knot;
    const float *c = walk->c;
    float sum = 0.0f;
    do {
        float x = *nodes;
        nodes++;
        if (!is_spanned) {
            const float *const last = &knot[1];
            x = clamped(*(last - walk->cells), *last, x, in_domain);
        }
        sum += value_within(knot, c, x);
        knot += walk->numbers;
        c += walk->numbers;
    } while (nodes < end);
    walk->knot = knot;
    walk->c = c;
    return sum;
}

kan_estimate_t kan_evaluate(const kan_model_t *model, const float *inputs)
{
    float layers[2][KAN_MAX_WIDTH];
    float *nodes = layers[0];
    float *sums = layers[1];
    bool in_domain = true;
    bool in_box = true;
    const float *center = model->input_center;
    const float *scale = model->input_scale;
    float *const end = &nodes[model->width[0]];
    float *node = nodes;
    do {
        const float value = (*inputs - *center) * *scale;
        inputs++;
        center++;
        scale++;
        *node = value;
        node++;
        if (!(fabsf(value) <= 1.0f)) {
            in_box = false;
        }
    } while (node < end);
    if (model->width[0] != BLOCK) {
        while (node < &layers[0][KAN_MAX_WIDTH]) {
            *node = 0.0f;
            node++;
        }
    }
    if (!is_in_slabs(model, nodes)) {
        in_domain = false;
    }
    if (!in_box && !clamp_to_reach(model, nodes)) {
        in_domain = false;
    }
    const uint32_t cells = model->cells;
    edge_walk_t walk = { &model->tables[cells - 1u], &model->tables[last_coefficients(cells)],
                         cells, edge_numbers(cells) };
    const uint32_t *width = model->width;
    const uint32_t *const last = &model->width[model->layers];
    bool is_spanned = model->spans_reach != 0u;
    do {
        const float *const layer_end = &nodes[*width];
        float *sum = sums;
        float *const sums_end = &sums[width[1]];
        do {
            *sum = sum_of_edges(&walk, nodes, layer_end, is_spanned, &in_domain);
            sum++;
        } while (sum < sums_end);
        float *const spent = nodes;
        nodes = sums;
        sums = spent;
        is_spanned = false;
        width++;
    } while (width < last);
    return (kan_estimate_t){ model->output_center_K + model->output_half_range_K * nodes[0],
                             in_domain };
}
