#include "kan.h"

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
        valid = valid && numeric_all_finite(direction->component, model->width[0]) &&
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
    for (uint32_t edge = 0u; edge < edges; edge++) {
        const float *knots = &model->knots[edge * (model->cells + 1u)];
        valid = valid && numeric_rises(knots, model->cells + 1u);
    }
    return valid && numeric_all_finite(model->coefficients,
                                       edges * model->cells * KAN_CELL_COEFFICIENTS);
}

typedef char kan_horner_has_all_coefficients[(KAN_CELL_COEFFICIENTS == 8) ? 1 : -1];

static inline float edge_value(const float *knots, const float *coefficients, uint32_t cells,
                               float x, bool *in_domain)
{
    /* Written so that an argument within the knots takes two comparisons, and NaN the first way. */
    const float first = knots[0];
    const float last = knots[cells];
    float inside = x;
    if (!(x >= first)) {
        inside = first;
        *in_domain &= (first - x <= KAN_FACE_TOLERANCE);
    } else if (!(x <= last)) {
        inside = last;
        *in_domain &= (x - last <= KAN_FACE_TOLERANCE);
    }
    uint32_t cell = 0u;
    while ((cell + 1u < cells) && (inside >= knots[cell + 1u])) {
        cell++;
    }
    const float middle = 0.5f * (knots[cell] + knots[cell + 1u]);
    const float d = inside - middle;
    const float *c = &coefficients[cell * KAN_CELL_COEFFICIENTS];
    return ((((((c[7] * d + c[6]) * d + c[5]) * d + c[4]) * d + c[3]) * d + c[2]) * d + c[1]) * d +
           c[0];
}

float kan_edge_value(const kan_model_t *model, uint32_t edge, float x, bool *in_domain)
{
    const uint32_t cells = model->cells;
    return edge_value(&model->knots[edge * (cells + 1u)],
                      &model->coefficients[edge * cells * KAN_CELL_COEFFICIENTS], cells, x,
                      in_domain);
}

/* False for NaN, which compares with nothing. */
static bool is_in_slabs(const kan_model_t *model, const float *normalised)
{
    const uint32_t inputs = model->width[0];
    const kan_direction_t *end = &model->direction[model->directions];
    for (const kan_direction_t *direction = model->direction; direction < end; direction++) {
        float along = 0.0f;
        for (uint32_t i = 0u; i < inputs; i++) {
            along += direction->component[i] * normalised[i];
        }
        if (!((along >= direction->low) && (along <= direction->high))) {
            return false;
        }
    }
    return true;
}

kan_estimate_t kan_evaluate(const kan_model_t *model, const float *inputs)
{
    float normalised[KAN_MAX_WIDTH];
    float layers[2][KAN_MAX_WIDTH];
    float *nodes = layers[0];
    float *sums = layers[1];
    kan_estimate_t estimate = { 0.0f, true };
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        const float value = (inputs[i] - model->input_center[i]) * model->input_scale[i];
        normalised[i] = value;
        float node = value;
        if (!((value >= -1.0f) && (value <= 1.0f))) {
            node = numeric_clamp(value, -model->input_reach, model->input_reach);
            if (!((value >= -KAN_FACE) && (value <= KAN_FACE))) {
                estimate.in_domain = false;
            }
        }
        nodes[i] = node;
    }
    if (!is_in_slabs(model, normalised)) {
        estimate.in_domain = false;
    }
    const uint32_t cells = model->cells;
    const float *knots = model->knots;
    const float *coefficients = model->coefficients;
    for (uint32_t layer = 0u; layer < model->layers; layer++) {
        for (uint32_t to = 0u; to < model->width[layer + 1u]; to++) {
            float sum = 0.0f;
            for (uint32_t from = 0u; from < model->width[layer]; from++) {
                sum += edge_value(knots, coefficients, cells, nodes[from], &estimate.in_domain);
                knots += cells + 1u;
                coefficients += cells * KAN_CELL_COEFFICIENTS;
            }
            sums[to] = sum;
        }
        float *const spent = nodes;
        nodes = sums;
        sums = spent;
    }
    estimate.core_temperature_K =
        model->output_center_K + model->output_half_range_K * nodes[0];
    return estimate;
}
