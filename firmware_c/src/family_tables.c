#include "family_tables.h"

#include <math.h>
#include <stddef.h>

#include "numeric.h"

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

float family_soc_at(const rcbf_constants_t *cell, float voltage_V)
{
    const uint32_t last = cell->ocv_points - 1u;
    const float clamped = numeric_clamp(voltage_V, cell->ocv_V[0], cell->ocv_V[last]);
    const uint32_t segment = numeric_segment(cell->ocv_V, cell->ocv_points, clamped);
    const float *at_V = &cell->ocv_V[segment];
    const float *at = &cell->ocv_soc[segment];
    const float share = (clamped - at_V[0]) / (at_V[1] - at_V[0]);
    return at[0] + share * (at[1] - at[0]);
}

float family_greatest(const float *cells, uint32_t first, uint32_t end)
{
    const float *last = &cells[end - 1u];
    float greatest = *last;
    for (const float *cell = &cells[first]; cell < last; cell++) {
        greatest = numeric_larger(greatest, *cell);
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
    return is_known ? numeric_larger(greatest, cells[end - 1u]) : family_greatest(cells, first, end);
}

/* In the last quarter of the last cell it goes on towards the next one's, so that no bound jumps where
 * that begins. */
static float towards_next(const float *cells, float greatest, uint32_t end, float share)
{
    const float rise = (end < FAMILY_SOC_CELLS) ? numeric_larger(0.0f, cells[end] - greatest) : 0.0f;
    return greatest + share * rise;
}

void family_look_up_cells(family_t *family, const family_constants_t *constants, float soc_low,
                          float soc_high)
{
    const uint32_t first = family_soc_cell(soc_low);
    const uint32_t end = family_soc_cell(soc_high) + 1u;
    const uint32_t was_first = family->first_cell;
    const uint32_t was_end = family->end_cell;
    if ((first != was_first) || (end != was_end)) {
        family->cells_slope_V = greatest_of(constants->ocv_slope_V, family->cells_slope_V, was_first,
                                          was_end, first, end);
        family->cells_entropic_V_per_K = greatest_of(constants->entropic_V_per_K,
                                               family->cells_entropic_V_per_K, was_first, was_end,
                                               first, end);
        family->first_cell = (uint8_t)first;
        family->end_cell = (uint8_t)end;
    }
    const float share = numeric_clamp(
        4.0f * (soc_high * (float)FAMILY_SOC_CELLS - (float)end) + 1.0f, 0.0f, 1.0f);
    family->ocv_slope_V = towards_next(constants->ocv_slope_V, family->cells_slope_V, end, share);
    family->entropic_V_per_K = towards_next(constants->entropic_V_per_K,
                                            family->cells_entropic_V_per_K, end, share);
}

float family_rise_V_per_s(const family_t *family, const family_constants_t *constants,
                          float strength_A)
{
    float rise_V_per_s = 0.0f;
    for (uint32_t i = 0u; i < constants->branches; i++) {
        rise_V_per_s += constants->branch[i].drift_ohm_per_s *
                        numeric_larger(0.0f, strength_A - family->weak_A[i]);
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
    const float past_A = numeric_larger(strength_A, heat->past_A);
    const float squared = strength_A * strength_A;
    const float more = heat->resistance_ohm * (squared - past_A * heat->at_least_A);
    const float less = heat->least_resistance_ohm * (squared - past_A * heat->at_least_A);
    return past_A * heat->overpotential_V + numeric_larger(more, less);
}

float family_assumed_heat_W(const family_heat_t *heat, float strength_A)
{
    const float past_A = numeric_larger(strength_A, heat->past_A);
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
    return numeric_smaller(grown_A, numeric_smaller(more_A, less_A));
}

float family_assumed_strength_A(const family_heat_t *heat, float square, float slope,
                                float limit_W)
{
    const float together_ohm = heat->resistance_ohm + heat->polarisation_ohm;
    const float past_W = heat->polarisation_ohm * heat->past_A * heat->past_A;
    return numeric_smaller(root_A(together_ohm + square, slope, limit_W),
                   root_A(heat->resistance_ohm + square, slope, limit_W - past_W));
}

static bool map_is_valid(const family_map_t *map)
{
    bool valid = (map->temperatures >= 2u) && (map->temperatures <= FAMILY_MAP_TEMPERATURES) &&
                 (map->charges >= 2u) && (map->charges <= FAMILY_MAP_CHARGES) &&
                 numeric_rises(map->temperature_K, map->temperatures) &&
                 numeric_rises(map->soc, map->charges);
    for (uint32_t i = 0u; valid && (i < map->temperatures * map->charges); i++) {
        valid = numeric_is_within(map->strength_A[i], 0.0f, FLT_MAX);
    }
    return valid;
}

static bool branches_are_valid(const family_constants_t *k)
{
    bool valid = k->branches <= FAMILY_MAX_BRANCHES;
    for (uint32_t i = 0u; valid && (i < k->branches); i++) {
        const family_branch_t *branch = &k->branch[i];
        valid = numeric_is_within(branch->slow, NUMERIC_LEAST, 1.0f) &&
                numeric_is_within(branch->fast, NUMERIC_LEAST, 1.0f) &&
                numeric_is_within(branch->resistance_ohm, 0.0f, FLT_MAX) &&
                numeric_is_within(branch->drift_ohm_per_s, 0.0f, FLT_MAX);
    }
    return valid;
}

#define AT(member) ((uint16_t)offsetof(family_constants_t, member))

/* Greatest at each temperature and at all warmer ones. */
static bool resistances_are_valid(const family_constants_t *k)
{
    bool valid = true;
    float colder_ohm = FLT_MAX;
    for (uint32_t i = 0u; i < FAMILY_TEMPERATURES; i++) {
        valid = valid && numeric_is_within(k->resistance_ohm[i], k->least_resistance_ohm,
                                           colder_ohm);
        colder_ohm = k->resistance_ohm[i];
    }
    return valid;
}

bool family_constants_are_valid(const family_constants_t *k)
{
    static const uint16_t POSITIVE[] = {
        AT(least_soc_per_A), AT(greatest_soc_per_A), AT(hold_soc_per_A),
        AT(coldest_K),       AT(per_step_K),         AT(least_resistance_ohm),
        AT(outflow_W_per_K), AT(core_K_per_J),       AT(heating_K_per_W),
        AT(cooling_K_per_W), AT(coldest_core_K),     AT(hold_s),
        AT(period_s),        AT(full_ocv_V),         AT(estimate_error_K),
    };
    static const uint16_t NOT_NEGATIVE[] = {
        AT(plug_in_error),        AT(ocv_error_V),
        AT(polarisation_ohm),     AT(rest_polarisation_V),
        AT(rest_drift_per_s),     AT(inner_K),
        AT(disturbance_W),        AT(disturbance_W_per_A),
        AT(disturbance_W_per_A2), AT(hold_W),
        AT(per_surface_rise),     AT(per_coolant_gap),
        AT(rest_error_K),         AT(least_per_surface_rise),
        AT(most_per_surface_fall), AT(least_per_coolant_gap),
        AT(charge_error_K),       AT(supply_tolerance),
        AT(current_error_A),      AT(voltage_error_V),
        AT(surface_error_K),      AT(coolant_error_K),
    };
    static const uint16_t SHARES[] = { AT(supply_share), AT(relaxation) };
    return (k->is_stated == 0u) ||
           (numeric_members_are_within(k, POSITIVE, NUMERIC_COUNT(POSITIVE), NUMERIC_LEAST,
                                       FLT_MAX) &&
            numeric_members_are_within(k, NOT_NEGATIVE, NUMERIC_COUNT(NOT_NEGATIVE), 0.0f,
                                       FLT_MAX) &&
            numeric_members_are_within(k, SHARES, NUMERIC_COUNT(SHARES), NUMERIC_LEAST, 1.0f) &&
            numeric_is_within(k->gain_W_per_K, k->outflow_W_per_K, FLT_MAX) &&
            (k->supply_tolerance < 1.0f) && (k->rest_periods >= 1u) &&
            (k->charge_periods >= 1u) && (k->full_periods >= 1u) && resistances_are_valid(k) &&
            numeric_all_finite(k->ocv_slope_V, FAMILY_SOC_CELLS) &&
            numeric_all_finite(k->entropic_V_per_K, FAMILY_SOC_CELLS) && branches_are_valid(k) &&
            map_is_valid(&k->map));
}
