#include "kan.h"

#include "numeric.h"

/* An input on a face of the box may come out of the scaling this much outside. */
#define KAN_FACE_TOLERANCE 1e-6f

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

float kan_edge_value(const kan_model_t *model, uint32_t edge, float x, bool *in_domain)
{
    const uint32_t cells = model->cells;
    const float *knots = &model->knots[edge * (cells + 1u)];
    const float *coefficients = &model->coefficients[edge * cells * KAN_CELL_COEFFICIENTS];
    const float clamped = numeric_clamp(x, knots[0], knots[cells]);
    const float beyond = x - clamped;
    if (!((beyond <= KAN_FACE_TOLERANCE) && (beyond >= -KAN_FACE_TOLERANCE))) {
        *in_domain = false;
    }
    uint32_t cell = 0u;
    while ((cell + 1u < cells) && (clamped >= knots[cell + 1u])) {
        cell++;
    }
    const float middle = 0.5f * (knots[cell] + knots[cell + 1u]);
    const float distance = clamped - middle;
    const float *polynomial = &coefficients[cell * KAN_CELL_COEFFICIENTS];
    float value = polynomial[KAN_CELL_COEFFICIENTS - 1];
    for (uint32_t i = KAN_CELL_COEFFICIENTS - 1u; i > 0u; i--) {
        value = value * distance + polynomial[i - 1u];
    }
    return value;
}

/* False for NaN, which compares with nothing. */
static bool is_in_slabs(const kan_model_t *model, const float *normalised)
{
    bool inside = true;
    for (uint32_t i = 0u; i < model->directions; i++) {
        const kan_direction_t *direction = &model->direction[i];
        float along = 0.0f;
        for (uint32_t k = 0u; k < model->width[0]; k++) {
            along += direction->component[k] * normalised[k];
        }
        inside = inside && (along >= direction->low) && (along <= direction->high);
    }
    return inside;
}

kan_estimate_t kan_evaluate(const kan_model_t *model, const float *inputs)
{
    float nodes[KAN_MAX_WIDTH] = { 0.0f };
    kan_estimate_t estimate = { 0.0f, true };
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        nodes[i] = (inputs[i] - model->input_center[i]) * model->input_scale[i];
        const float beyond = nodes[i] - numeric_clamp(nodes[i], -1.0f, 1.0f);
        if (!((beyond <= KAN_FACE_TOLERANCE) && (beyond >= -KAN_FACE_TOLERANCE))) {
            estimate.in_domain = false;
        }
    }
    estimate.in_domain = is_in_slabs(model, nodes) && estimate.in_domain;
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        nodes[i] = numeric_clamp(nodes[i], -model->input_reach, model->input_reach);
    }
    uint32_t edge = 0u;
    for (uint32_t layer = 0u; layer < model->layers; layer++) {
        float sums[KAN_MAX_WIDTH] = { 0.0f };
        for (uint32_t to = 0u; to < model->width[layer + 1u]; to++) {
            for (uint32_t from = 0u; from < model->width[layer]; from++) {
                sums[to] += kan_edge_value(model, edge, nodes[from], &estimate.in_domain);
                edge++;
            }
        }
        for (uint32_t i = 0u; i < KAN_MAX_WIDTH; i++) {
            nodes[i] = sums[i];
        }
    }
    estimate.core_temperature_K =
        model->output_center_K + model->output_half_range_K * nodes[0];
    return estimate;
}
