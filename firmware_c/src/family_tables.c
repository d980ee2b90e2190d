#include "family_tables.h"

#include <math.h>

#include "numeric.h"

static float smaller(float a, float b)
{
    return (a < b) ? a : b;
}

static float larger(float a, float b)
{
    return (a > b) ? a : b;
}

float family_resistance_ohm(const family_constants_t *constants, float temperature_K)
{
    const float last = (float)(FAMILY_TEMPERATURES - 1);
    const float at = numeric_clamp(
        (temperature_K - constants->coldest_K) * constants->per_step_K, 0.0f, last);
    uint32_t below = (uint32_t)at;
    if (below > FAMILY_TEMPERATURES - 2u) {
        below = FAMILY_TEMPERATURES - 2u;
    }
    const float share = at - (float)below;
    const float *ohm = &constants->resistance_ohm[below];
    return ohm[0] + share * (ohm[1] - ohm[0]);
}

uint32_t family_soc_cell(float soc)
{
    return (uint32_t)numeric_clamp(soc * (float)FAMILY_SOC_CELLS, 0.0f,
                                   (float)(FAMILY_SOC_CELLS - 1));
}

float family_greatest(const float *cells, uint32_t first, uint32_t end)
{
    const float *last = &cells[end - 1u];
    float greatest = *last;
    for (const float *cell = &cells[first]; cell < last; cell++) {
        greatest = larger(greatest, *cell);
    }
    return greatest;
}

/* Greatest value of the cells from first to before end; `greatest` is that of those from was_first
 * to before was_end, which mostly tells it. */
static float greatest_of(const float *cells, float greatest, uint32_t was_first, uint32_t was_end,
                         uint32_t first, uint32_t end)
{
    bool is_known = (first >= was_first) && (first < was_end) && (end >= was_end) &&
                    (end - was_end <= 1u);
    for (uint32_t i = was_first; is_known && (i < first); i++) {
        is_known = cells[i] < greatest;
    }
    return is_known ? larger(greatest, cells[end - 1u]) : family_greatest(cells, first, end);
}

void family_look_up_cells(family_t *family, const family_constants_t *constants, float soc_low,
                          float soc_high)
{
    const uint32_t first = family_soc_cell(soc_low);
    const uint32_t end = family_soc_cell(soc_high) + 1u;
    const uint32_t was_first = family->first_cell;
    const uint32_t was_end = family->end_cell;
    if ((first != was_first) || (end != was_end)) {
        family->ocv_slope_V = greatest_of(constants->ocv_slope_V, family->ocv_slope_V, was_first,
                                          was_end, first, end);
        family->entropic_V_per_K = greatest_of(constants->entropic_V_per_K,
                                               family->entropic_V_per_K, was_first, was_end,
                                               first, end);
        family->first_cell = (uint8_t)first;
        family->end_cell = (uint8_t)end;
    }
}

float family_rise_V_per_s(const family_t *family, const family_constants_t *constants,
                          float strength_A)
{
    float rise_V_per_s = 0.0f;
    for (uint32_t i = 0u; i < constants->branches; i++) {
        rise_V_per_s += constants->branch[i].drift_ohm_per_s *
                        larger(0.0f, strength_A - family->weak_A[i]);
    }
    return rise_V_per_s;
}

static uint32_t below(const float *axis, uint32_t points, float at)
{
    uint32_t i = 0u;
    while ((i + 2u < points) && (at >= axis[i + 1u])) {
        i++;
    }
    return i;
}

float family_mapped_A(const family_map_t *map, float temperature_K, float soc)
{
    const uint32_t row = below(map->temperature_K, map->temperatures, temperature_K);
    const uint32_t column = below(map->soc, map->charges, soc);
    const float *warmth = &map->temperature_K[row];
    const float *charge = &map->soc[column];
    const float by_warmth =
        numeric_clamp((temperature_K - warmth[0]) / (warmth[1] - warmth[0]), 0.0f, 1.0f);
    const float by_charge = numeric_clamp((soc - charge[0]) / (charge[1] - charge[0]), 0.0f, 1.0f);
    const float *cold = &map->strength_A[row * map->charges + column];
    const float *warm = &cold[map->charges];
    const float cold_A = cold[0] + by_charge * (cold[1] - cold[0]);
    const float warm_A = warm[0] + by_charge * (warm[1] - warm[0]);
    return cold_A + by_warmth * (warm_A - cold_A);
}

/* With V_i of the branches and W the larger of a and past_A, V_i <= R_i W, so that
 *   heat = R0 a^2 + sum V_i^2 / R_i <= R0 a^2 + W sum V_i = W eta + R0 (a^2 - W a_m)
 * where eta is the overpotential at a_m. The worst a_m is the least, the worst R0 an end. */
float family_measured_heat_W(const family_heat_t *heat, float strength_A)
{
    const float past_A = larger(strength_A, heat->past_A);
    const float squared = strength_A * strength_A;
    const float more = heat->resistance_ohm * (squared - past_A * heat->at_least_A);
    const float less = heat->least_resistance_ohm * (squared - past_A * heat->at_least_A);
    return past_A * heat->overpotential_V + larger(more, less);
}

float family_assumed_heat_W(const family_heat_t *heat, float strength_A)
{
    const float past_A = larger(strength_A, heat->past_A);
    return heat->resistance_ohm * strength_A * strength_A +
           heat->polarisation_ohm * past_A * past_A;
}

/* Larger root of square a^2 + slope a = limit, for square > 0. */
static float root_A(float square, float slope, float limit)
{
    const float discriminant = slope * slope + 4.0f * square * limit;
    if (!(limit >= 0.0f) || !(discriminant >= 0.0f)) {
        return -1.0f;
    }
    const float root = sqrtf(discriminant);
    return (slope > 0.0f) ? (2.0f * limit / (slope + root)) : ((root - slope) / (2.0f * square));
}

float family_measured_strength_A(const family_heat_t *heat, float square, float slope,
                                 float limit_W)
{
    const float eta_V = heat->overpotential_V;
    const float past_A = heat->past_A;
    const float grown_A = root_A(heat->resistance_ohm + square,
                                 slope + eta_V - heat->resistance_ohm * heat->at_least_A, limit_W);
    const float more_A =
        root_A(heat->resistance_ohm + square, slope,
               limit_W - past_A * (eta_V - heat->resistance_ohm * heat->at_least_A));
    const float less_A =
        root_A(heat->least_resistance_ohm + square, slope,
               limit_W - past_A * (eta_V - heat->least_resistance_ohm * heat->at_least_A));
    return smaller(grown_A, smaller(more_A, less_A));
}

float family_assumed_strength_A(const family_heat_t *heat, float square, float slope,
                                float limit_W)
{
    const float together_ohm = heat->resistance_ohm + heat->polarisation_ohm;
    const float past_W = heat->polarisation_ohm * heat->past_A * heat->past_A;
    return smaller(root_A(together_ohm + square, slope, limit_W),
                   root_A(heat->resistance_ohm + square, slope, limit_W - past_W));
}

static bool is_positive(float value)
{
    return (value > 0.0f) && (value <= FLT_MAX);
}

static bool is_not_negative(float value)
{
    return (value >= 0.0f) && (value <= FLT_MAX);
}

static bool is_share(float value)
{
    return (value > 0.0f) && (value <= 1.0f);
}

static bool map_is_valid(const family_map_t *map)
{
    bool valid = (map->temperatures >= 2u) && (map->temperatures <= FAMILY_MAP_TEMPERATURES) &&
                 (map->charges >= 2u) && (map->charges <= FAMILY_MAP_CHARGES) &&
                 numeric_rises(map->temperature_K, map->temperatures) &&
                 numeric_rises(map->soc, map->charges);
    for (uint32_t i = 0u; valid && (i < map->temperatures * map->charges); i++) {
        valid = is_not_negative(map->strength_A[i]);
    }
    return valid;
}

static bool branches_are_valid(const family_constants_t *k)
{
    bool valid = k->branches <= FAMILY_MAX_BRANCHES;
    for (uint32_t i = 0u; valid && (i < k->branches); i++) {
        const family_branch_t *branch = &k->branch[i];
        valid = is_share(branch->slow) && is_share(branch->fast) &&
                is_not_negative(branch->resistance_ohm) &&
                is_not_negative(branch->drift_ohm_per_s);
    }
    return valid;
}

bool family_constants_are_valid(const family_constants_t *k)
{
    if (k->is_stated == 0u) {
        return true;
    }
    const float positive[] = { k->least_soc_per_A,  k->greatest_soc_per_A, k->hold_soc_per_A,
                               k->coldest_K,        k->per_step_K,         k->least_resistance_ohm,
                               k->outflow_W_per_K,  k->core_K_per_J,       k->heating_K_per_W,
                               k->cooling_K_per_W,  k->coldest_core_K,     k->hold_s,
                               k->period_s,         k->full_ocv_V,       k->estimate_error_K };
    const float not_negative[] = { k->plug_in_error,        k->ocv_error_V,
                                   k->polarisation_ohm,     k->rest_polarisation_V,
                                   k->rest_drift_per_s,     k->inner_K,
                                   k->disturbance_W,        k->disturbance_W_per_A,
                                   k->disturbance_W_per_A2, k->hold_W,
                                   k->per_surface_rise,     k->per_coolant_gap,
                                   k->rest_error_K,         k->least_per_surface_rise,
                                   k->most_per_surface_fall, k->least_per_coolant_gap,
                                   k->charge_error_K,       k->supply_tolerance,
                                   k->current_error_A,      k->voltage_error_V,
                                   k->surface_error_K,      k->coolant_error_K };
    bool valid = (k->gain_W_per_K >= k->outflow_W_per_K) && (k->gain_W_per_K <= FLT_MAX) &&
                 (k->supply_tolerance < 1.0f) && is_share(k->supply_share) &&
                 is_share(k->relaxation) && (k->rest_periods >= 1u) &&
                 (k->charge_periods >= 1u) && (k->full_periods >= 1u);
    for (uint32_t i = 0u; i < sizeof positive / sizeof positive[0]; i++) {
        valid = valid && is_positive(positive[i]);
    }
    for (uint32_t i = 0u; i < sizeof not_negative / sizeof not_negative[0]; i++) {
        valid = valid && is_not_negative(not_negative[i]);
    }
    for (uint32_t i = 0u; i < FAMILY_TEMPERATURES; i++) {
        valid = valid && (k->resistance_ohm[i] >= k->least_resistance_ohm) &&
                is_positive(k->resistance_ohm[i]) &&
                ((i == 0u) || (k->resistance_ohm[i] <= k->resistance_ohm[i - 1u]));
    }
    return valid && numeric_all_finite(k->ocv_slope_V, FAMILY_SOC_CELLS) &&
           numeric_all_finite(k->entropic_V_per_K, FAMILY_SOC_CELLS) && branches_are_valid(k) &&
           map_is_valid(&k->map);
}
