#include "plain_kernels.h"

#include <float.h>
#include <math.h>

static float clamp(float value, float low, float high)
{
    if (!(value >= low)) {
        return low; /* NaN too */
    }
    return (value <= high) ? value : high;
}

static float edge_at(const kan_model_t *model, const float *table, float x, bool *in_domain)
{
    const uint32_t cells = model->cells;
    const float first = table[0];
    const float last = table[cells];
    *in_domain = *in_domain && !isnan(x) && (first - x <= 1e-6f) && (x - last <= 1e-6f);
    const float within = clamp(x, first, last);
    uint32_t cell = 0u;
    for (uint32_t i = 1u; i < cells; i++) {
        if (within >= table[i]) {
            cell = i;
        }
    }
    const float d = within - 0.5f * (table[cell] + table[cell + 1u]);
    const float *c = &table[cells + 1u + cell * KAN_CELL_COEFFICIENTS];
    float value = c[KAN_CELL_COEFFICIENTS - 1u];
    for (uint32_t i = KAN_CELL_COEFFICIENTS - 1u; i > 0u; i--) {
        value = value * d + c[i - 1u];
    }
    return value;
}

kan_estimate_t plain_estimate(const kan_model_t *model, const float *inputs)
{
    float nodes[KAN_MAX_WIDTH] = { 0.0f };
    bool in_domain = true;
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        nodes[i] = (inputs[i] - model->input_center[i]) * model->input_scale[i];
    }
    for (uint32_t n = 0u; n < model->directions; n++) {
        const kan_direction_t *direction = &model->direction[n];
        float along = 0.0f;
        for (uint32_t i = 0u; i < KAN_MAX_WIDTH; i++) {
            along += direction->component[i] * nodes[i];
        }
        in_domain = in_domain && (along >= direction->low) && (along <= direction->high);
    }
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        in_domain = in_domain && (nodes[i] >= -(1.0f + 1e-6f)) && (nodes[i] <= 1.0f + 1e-6f);
        nodes[i] = clamp(nodes[i], -model->input_reach, model->input_reach);
    }
    const float *table = model->tables;
    for (uint32_t layer = 0u; layer < model->layers; layer++) {
        float sums[KAN_MAX_WIDTH] = { 0.0f };
        for (uint32_t to = 0u; to < model->width[layer + 1u]; to++) {
            for (uint32_t from = 0u; from < model->width[layer]; from++) {
                sums[to] += edge_at(model, table, nodes[from], &in_domain);
                table += model->cells + 1u + model->cells * KAN_CELL_COEFFICIENTS;
            }
        }
        for (uint32_t i = 0u; i < KAN_MAX_WIDTH; i++) {
            nodes[i] = sums[i];
        }
    }
    return (kan_estimate_t){ model->output_center_K + model->output_half_range_K * nodes[0],
                             in_domain };
}

float plain_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc)
{
    const uint32_t last = constants->ocv_points - 1u;
    const float *at = constants->ocv_soc;
    const float *at_V = constants->ocv_V;
    const float within = clamp(soc, at[0], at[last]);
    uint32_t i = 0u;
    while ((i + 1u < last) && (within > at[i + 1u])) {
        i++;
    }
    const float slope_V = (at_V[i + 1u] - at_V[i]) / (at[i + 1u] - at[i]);
    return at_V[i] + slope_V * (within - at[i]);
}

static float difference_K(rcbf_temperature_t a, rcbf_temperature_t b)
{
    return (a.high_K - b.high_K) + (a.low_K - b.low_K);
}

static bool is_temperature(rcbf_temperature_t temperature)
{
    return (temperature.high_K >= 150.0f) && (temperature.high_K <= 450.0f) &&
           (fabsf(temperature.low_K) <= 450.0f * FLT_EPSILON);
}

static bool is_physical(const rcbf_input_t *in)
{
    return is_temperature(in->core_temperature_K) && is_temperature(in->surface_temperature_K) &&
           is_temperature(in->coolant_temperature_K) && (in->soc >= -0.1f) && (in->soc <= 1.1f) &&
           (fabsf(in->cooling_power_W) <= 1e4f) && (in->reference_current_A >= -1e4f) &&
           (in->reference_current_A <= 0.0f);
}

typedef struct {
    float constant;
    float linear;
    float quadratic;
} parabola_t;

static void narrow(rcbf_decision_t *to, parabola_t f, rcbf_active_t name)
{
    float low_A = 1.0f;
    float high_A = -1.0f;
    const float discriminant = f.linear * f.linear - 4.0f * f.quadratic * f.constant;
    if (discriminant >= 0.0f) {
        const float root = sqrtf(discriminant);
        const float sum = -0.5f * (f.linear + ((f.linear < 0.0f) ? -root : root));
        const float first = sum / f.quadratic;
        const float second = (sum != 0.0f) ? (f.constant / sum) : 0.0f;
        low_A = (first < second) ? first : second;
        high_A = (first < second) ? second : first;
    }
    if (!(low_A <= to->lower_A)) {
        to->lower_A = (low_A <= FLT_MAX) ? low_A : FLT_MAX;
        to->active = name;
    }
    if (!(high_A >= to->upper_A)) {
        to->upper_A = (high_A >= -FLT_MAX) ? high_A : -FLT_MAX;
    }
}

static float value_at(parabola_t f, float u)
{
    return f.constant + u * (f.linear + u * f.quadratic);
}

static float steadied(float *kept, float now, float margin)
{
    *kept += 0.2f * (now - 0.125f * margin - *kept);
    if (!(*kept <= now)) {
        *kept = now;
    }
    return *kept;
}

rcbf_decision_t plain_decision(const rcbf_constants_t *k, const rcbf_input_t *in,
                               float open_circuit_voltage_V, rcbf_steadier_t *steadier)
{
    rcbf_decision_t decision = { .active = RCBF_INVALID };
    if (!is_physical(in)) {
        return decision;
    }
    const float e_K = k->estimation_error_bound_K;
    const float core_K = in->core_temperature_K.high_K;
    const float core_over_surface_K =
        difference_K(in->core_temperature_K, in->surface_temperature_K);
    const float voltage_V = k->max_voltage_V - open_circuit_voltage_V - k->voltage_margin_V;
    const float soc_per_s = k->alpha1_per_s * (k->max_soc - in->soc) - k->soc_uncertainty_per_s -
                            k->soc_margin_per_s;
    const float per_capacity_As = 1.0f / k->capacity_As;
    const float core = steadied(
        &steadier->core_K_per_s,
        k->a1_per_s * core_over_surface_K +
            k->alpha2_per_s * difference_K(k->max_core_temperature_K, in->core_temperature_K) -
            (k->core_uncertainty_K_per_s + k->core_margin_K_per_s),
        k->core_margin_K_per_s);
    const float surface = steadied(
        &steadier->surface_K_per_s2,
        k->a4_per_s2 * core_over_surface_K +
            k->a6_per_s2 * difference_K(in->coolant_temperature_K, in->surface_temperature_K) +
            k->alpha3_per_s2 *
                difference_K(k->max_surface_temperature_K, in->surface_temperature_K) +
            k->a10_K_per_Ws2 * in->cooling_power_W -
            (k->delta4_K_per_s2 + k->surface_margin_K_per_s2),
        k->surface_margin_K_per_s2);
    const float core_rest = (k->a1_per_s - k->alpha2_per_s) * e_K;
    const float surface_rest = k->a4_per_s2 * e_K;
    const float core_slope = k->a2_per_As * core_K;
    const float surface_slope = k->a8_per_As2 * core_K;
    const parabola_t f[4] = {
        { core - core_rest, core_slope - k->a2_per_As * e_K, -k->a3_K_per_A2s },
        { core + core_rest, core_slope + k->a2_per_As * e_K, -k->a3_K_per_A2s },
        { surface - surface_rest, surface_slope - k->a8_per_As2 * e_K, k->a9_K_per_A2s2 },
        { surface + surface_rest, surface_slope + k->a8_per_As2 * e_K, k->a9_K_per_A2s2 },
    };
    decision.lower_A = in->reference_current_A;
    decision.upper_A = 0.0f;
    decision.active = RCBF_NONE;
    const float lines_A[2] = { -voltage_V / k->ohmic_resistance_ohm, -soc_per_s / per_capacity_As };
    for (uint32_t i = 0u; i < 2u; i++) {
        if (!(lines_A[i] <= decision.lower_A)) {
            decision.lower_A = (lines_A[i] <= FLT_MAX) ? lines_A[i] : FLT_MAX;
            decision.active = (i == 0u) ? RCBF_VOLTAGE : RCBF_SOC;
        }
    }
    for (uint32_t i = 0u; i < 4u; i++) {
        narrow(&decision, f[i], (i < 2u) ? RCBF_CORE : RCBF_SURFACE);
    }
    decision.feasible = decision.lower_A <= decision.upper_A;
    if (!decision.feasible) {
        decision.active = RCBF_INFEASIBLE;
    }
    const float u = decision.feasible ? decision.lower_A : 0.0f;
    decision.current_A = u;
    decision.margins[0] = voltage_V + u * k->ohmic_resistance_ohm;
    decision.margins[1] = soc_per_s + u * per_capacity_As;
    for (uint32_t i = 0u; i < 2u; i++) {
        const float less = value_at(f[2u * i], u);
        const float more = value_at(f[2u * i + 1u], u);
        decision.margins[2u + i] = (less < more) ? less : more;
    }
    return decision;
}

uint8_t plain_crc(const uint8_t *data, uint8_t length, uint8_t data_id)
{
    uint8_t crc = 0xFFu;
    for (uint32_t i = 1u; i <= length; i++) {
        crc ^= (i < length) ? data[i] : data_id;
        for (uint32_t bit = 0u; bit < 8u; bit++) {
            crc = (uint8_t)((uint32_t)(crc << 1u) ^ (((crc & 0x80u) != 0u) ? 0x2Fu : 0u));
        }
    }
    return crc ^ 0xFFu;
}

static uint32_t cell_of(float soc)
{
    return (uint32_t)clamp(soc * (float)FAMILY_SOC_CELLS, 0.0f, (float)(FAMILY_SOC_CELLS - 1));
}

float plain_greatest(const float *cells, float soc_low, float soc_high)
{
    const uint32_t end = cell_of(soc_high) + 1u;
    float greatest = -FLT_MAX;
    for (uint32_t i = cell_of(soc_low); i < end; i++) {
        greatest = fmaxf(greatest, cells[i]);
    }
    const float share =
        clamp(4.0f * (soc_high * (float)FAMILY_SOC_CELLS - (float)end) + 1.0f, 0.0f, 1.0f);
    const float rise = (end < FAMILY_SOC_CELLS) ? fmaxf(0.0f, cells[end] - greatest) : 0.0f;
    return greatest + share * rise;
}
