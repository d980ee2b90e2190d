#include "family.h"

#include <float.h>

#include "family_tables.h"
#include "numeric.h"

/* Of the way to the present voltage that the steadied one goes in a period, and what it keeps above
 * it on average, as a share of the reading's error; that much noise does not move it at once. */
#define STEADY_SHARE 0.4f
#define STEADY_RESERVE 0.5f

/* Periods without usable readings that are bridged. */
#define MAX_BRIDGED 3u

static void forget_core(family_t *family)
{
    family->soc_known = false;
    family->core_is_known = false;
    family->core_room_K = 0.0f;
    family->rest.count = 0u;
    family->charge.count = 0u;
    family->heat_W = 0.0f;
    family->surface_temperature_K = -FLT_MAX;
}

/* A load heats and polarises the cell in ways that nobody follows here. */
static void forget_after_load(family_t *family, const family_constants_t *constants)
{
    forget_core(family);
    family->rest_polarisation_V = constants->rest_polarisation_V;
    /* What a load has left goes down as what was there at plug-in. */
    for (uint32_t i = 0u; i < FAMILY_MAX_BRANCHES; i++) {
        family->weak_A[i] = 0.0f;
    }
}

void family_reset(family_t *family, const family_constants_t *constants)
{
    *family = (family_t){
        .unknown_ocv_slope_V = family_greatest(constants->ocv_slope_V, 0u, FAMILY_SOC_CELLS),
        .unknown_entropic_V_per_K =
            family_greatest(constants->entropic_V_per_K, 0u, FAMILY_SOC_CELLS),
    };
    forget_core(family);
}

NUMERIC_INLINE void follow_supply(family_t *family, const family_constants_t *constants,
                                  float command_A)
{
    const float last_A = family->commands_A[0];
    const float earlier_A = family->commands_A[1];
    const float low_A = numeric_smaller(command_A, numeric_smaller(last_A, earlier_A));
    const float high_A = numeric_larger(command_A, numeric_larger(last_A, earlier_A));
    const float rise_A = low_A - family->supply_low_A;
    const float fall_A = high_A - family->supply_high_A;
    family->supply_low_A += (rise_A > 0.0f) ? (constants->supply_share * rise_A) : rise_A;
    family->supply_high_A += (fall_A < 0.0f) ? (constants->supply_share * fall_A) : fall_A;
    family->commands_A[1] = last_A;
    family->commands_A[0] = command_A;
}

/* All branches, at what may flow in their resistances. */
typedef struct {
    float most_V;
    float rise_V_per_s; /* of their voltages at a strength that holds on, at most */
} branches_t;

/* The current in a branch's resistance follows that of the cell as a first-order lag does; whatever
 * its time constant, it stays between one that rises fast and falls slowly and the reverse. */
static branches_t follow_branches(family_t *family, const family_constants_t *constants,
                                  float least_A, float most_A, float strength_A)
{
    branches_t all = { 0.0f, 0.0f };
    float strongest_A = most_A;
    for (uint32_t i = 0u; i < constants->branches; i++) {
        const family_branch_t *branch = &constants->branch[i];
        float strong_A = family->strong_A[i];
        float weak_A = family->weak_A[i];
        const float up_A = most_A - strong_A;
        const float down_A = least_A - weak_A;
        strong_A += ((up_A > 0.0f) ? branch->fast : branch->slow) * up_A;
        weak_A += ((down_A > 0.0f) ? branch->slow : branch->fast) * down_A;
        family->strong_A[i] = strong_A;
        family->weak_A[i] = weak_A;
        strongest_A = numeric_larger(strongest_A, strong_A);
        all.most_V += branch->resistance_ohm * strong_A;
        all.rise_V_per_s += branch->drift_ohm_per_s * numeric_larger(0.0f, strength_A - weak_A);
    }
    family->strongest_A = strongest_A;
    return all;
}

/* Between two readings the current lies between them. */
NUMERIC_INLINE branches_t follow_charge(family_t *family, const family_constants_t *constants,
                                        float strength_A)
{
    const float error_A = constants->current_error_A;
    const float before_A = family->strength_A;
    const float least_A = numeric_larger(numeric_smaller(strength_A, before_A) - error_A, 0.0f);
    const float most_A = numeric_larger(before_A, strength_A) + error_A;
    family->strength_A = strength_A;
    soc_add(&family->soc_low, least_A * constants->least_soc_per_A);
    soc_add(&family->soc_high, most_A * constants->greatest_soc_per_A);
    family->rest_polarisation_V *= constants->relaxation;
    return follow_branches(family, constants, least_A, most_A, strength_A + error_A);
}

NUMERIC_INLINE void look_up(family_t *family, const family_constants_t *constants,
                            const rcbf_constants_t *cell, const family_reading_t *reading)
{
    float low = 0.0f;
    if (family->soc_known) {
        low = family->soc_low.soc;
        family_look_up_cells(
            family, constants, low,
            family->soc_high.soc + constants->hold_soc_per_A * family->strongest_A);
    } else {
        family->ocv_slope_V = family->unknown_ocv_slope_V;
        family->entropic_V_per_K = family->unknown_entropic_V_per_K;
        family->end_cell = 0u;
    }
    family->entropic_V =
        family->entropic_V_per_K *
        ((family->entropic_V_per_K > 0.0f) ? cell->max_core_temperature_K.high_K
                                           : constants->coldest_core_K);
    family->overpotential_V =
        numeric_larger(0.0f, reading->voltage_V -
                         rcbf_open_circuit_voltage_near_V(cell, low, &family->ocv_segment) +
                         constants->ocv_error_V + constants->voltage_error_V +
                         2.0f * family->rest_polarisation_V);
}

/* What the branches hold is no more than before and what they take up in a period, nor than what
 * they hold at their strongest current, or than the overpotential leaves beside the least ohmic
 * drop. */
NUMERIC_INLINE void follow_polarisation(family_t *family, const family_constants_t *constants,
                                        const branches_t *branches, float at_least_A)
{
    const float risen_V = family->polarisation_V + constants->period_s * branches->rise_V_per_s;
    const float seen_V =
        numeric_larger(0.0f, family->overpotential_V - constants->least_resistance_ohm * at_least_A);
    family->polarisation_V = numeric_smaller(branches->most_V, numeric_smaller(risen_V, seen_V));
}

family_heat_t family_heat(const family_t *family, const family_constants_t *constants,
                          float strength_A)
{
    return (family_heat_t){
        .overpotential_V = family->overpotential_V,
        .at_least_A = numeric_larger(strength_A - constants->current_error_A, 0.0f),
        .at_most_A = strength_A + constants->current_error_A,
        .past_A = family->strongest_A,
        .resistance_ohm = family->resistance_ohm,
        .least_resistance_ohm = constants->least_resistance_ohm,
        .polarisation_ohm = constants->polarisation_ohm,
    };
}

/* The core obeys C T' = heat - (T - Ts) / R + C nu, and the right-hand side is largest for the
 * greatest R where T is above Ts; so what rises as with the least C and falls as with the greatest
 * C stays above every core of the family. A core below its surface is warmed the more the smaller R
 * is, so that the bound is no lower than the surface. A fall is taken at its end, where it is
 * slowest. */
NUMERIC_INLINE void follow_core(family_t *family, const family_constants_t *constants,
                                const rcbf_constants_t *cell, const family_reading_t *reading,
                                const family_heat_t *heat)
{
    const float strength_A = heat->at_most_A;
    const float heat_W = numeric_smaller(family_measured_heat_W(heat, strength_A),
                                 family_assumed_heat_W(heat, strength_A)) +
                         family->entropic_V * strength_A;
    const float surface_K =
        numeric_larger(reading->surface_temperature_K, family->surface_temperature_K);
    const float surface_room_K = (cell->max_core_temperature_K.high_K - surface_K) +
                                 cell->max_core_temperature_K.low_K - constants->surface_error_K;
    family->core_room_K = numeric_smaller(family->core_room_K, surface_room_K);
    const float disturbance_W =
        constants->disturbance_W +
        strength_A * (constants->disturbance_W_per_A +
                      strength_A * constants->disturbance_W_per_A2);
    const float net_W = numeric_larger(heat_W, family->heat_W) + disturbance_W -
                        constants->outflow_W_per_K * (surface_room_K - family->core_room_K);
    family->core_room_K -=
        ((net_W > 0.0f) ? constants->heating_K_per_W : constants->cooling_K_per_W) * net_W;
    family->heat_W = heat_W;
    family->surface_temperature_K = reading->surface_temperature_K;
    family->core_is_known = family->core_is_known && numeric_is_finite(family->core_room_K);
}

/* What resistance and polarisation cannot explain of the voltage is open-circuit voltage. */
NUMERIC_INLINE void look_for_full(family_t *family, const family_constants_t *constants,
                                  const family_reading_t *reading, float at_most_A)
{
    const float least_ocv_V =
        reading->voltage_V - constants->voltage_error_V - constants->ocv_error_V -
        family->rest_polarisation_V - family->resistance_ohm * at_most_A -
        family->polarisation_V;
    const bool is_full = reading->is_charging && (least_ocv_V >= constants->full_ocv_V);
    family->full_count = is_full ? (family->full_count + 1u) : 0u;
}

/* Without readings the core takes up all the heat that the strongest possible current can make; for
 * a few periods only, since the reaction to missing readings is 0 A and nothing is known long. */
static void bridge(family_t *family, const family_constants_t *constants)
{
    family->bridged++;
    family->rest.count = 0u;
    family->charge.count = 0u;
    if (family->bridged > MAX_BRIDGED) {
        forget_after_load(family, constants);
        return;
    }
    const float strength_A = family->supply_high_A * (1.0f + constants->supply_tolerance);
    const family_heat_t heat = {
        .past_A = numeric_larger(strength_A, family->strongest_A),
        .resistance_ohm = constants->resistance_ohm[0],
        .polarisation_ohm = constants->polarisation_ohm,
    };
    soc_add(&family->soc_high, strength_A * constants->greatest_soc_per_A);
    family->polarisation_V +=
        constants->period_s * family_rise_V_per_s(family, constants, strength_A);
    (void)follow_branches(family, constants, 0.0f, strength_A, strength_A);
    family->strength_A = strength_A;
    family->core_room_K -=
        constants->heating_K_per_W *
        (family_assumed_heat_W(&heat, strength_A) + numeric_larger(0.0f, family->entropic_V) * strength_A +
         constants->disturbance_W +
         strength_A * (constants->disturbance_W_per_A +
                       strength_A * constants->disturbance_W_per_A2));
}

/* The voltage less the least ohmic drop, steadied: never less than was read, so that only current is
 * lost by it. What is no number gives way to the reading. */
NUMERIC_INLINE void steady_voltage(family_t *family, const family_constants_t *constants,
                                   float voltage_V, float strength_A)
{
    const float read_V = voltage_V - constants->least_resistance_ohm * strength_A;
    float steady_V = family->steady_voltage_V;
    steady_V += STEADY_SHARE * (read_V + STEADY_RESERVE * constants->voltage_error_V - steady_V);
    if (!(steady_V >= read_V)) {
        steady_V = read_V;
    }
    family->steady_voltage_V = steady_V;
    family->steadied_V = steady_V - read_V;
}

void family_observe(family_t *family, const family_constants_t *constants,
                    const rcbf_constants_t *cell, const family_reading_t *reading)
{
    follow_supply(family, constants, numeric_larger(-reading->command_A, 0.0f));
    family->resistance_ohm = family_resistance_ohm(
        constants, reading->surface_temperature_K - constants->surface_error_K);
    if (!reading->is_usable) {
        bridge(family, constants);
        return;
    }
    family->bridged = 0u;
    const float strength_A = numeric_larger(-reading->current_A, 0.0f);
    const branches_t branches = follow_charge(family, constants, strength_A);
    look_up(family, constants, cell, reading);
    const family_heat_t heat = family_heat(family, constants, strength_A);
    follow_polarisation(family, constants, &branches, heat.at_least_A);
    look_for_full(family, constants, reading, heat.at_most_A);
    steady_voltage(family, constants, reading->voltage_V, strength_A);
    const bool rests = family_is_at_rest(constants, reading);
    if (!rests && !reading->is_charging) {
        forget_after_load(family, constants);
        return;
    }
    follow_core(family, constants, cell, reading, &heat);
    if (rests) {
        family_look_at_rest(family, constants, cell, reading);
        family->charge.count = 0u;
    } else {
        family_look_in_charge(family, constants, cell, reading);
        family->rest.count = 0u;
    }
}
