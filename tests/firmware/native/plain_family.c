#include <float.h>
#include <math.h>
#include <stddef.h>

#include "family_tables.h"
#include "plain_kernels.h"

static float larger(float a, float b)
{
    return (a > b) ? a : b;
}

static float smaller(float a, float b)
{
    return (a < b) ? a : b;
}

static void weaken(float *strength_A, rcbf_active_t *active, float to_A, rcbf_active_t name)
{
    if (!(*strength_A <= to_A)) {
        *strength_A = to_A;
        *active = name;
    }
}

/* The decision; at another strength than its own, where one is given, what is left there. */
static rcbf_decision_t decided(const family_t *family, const family_constants_t *k,
                               const rcbf_constants_t *cell, const family_reading_t *in,
                               float reference_A, const float *at_A)
{
    if (!in->is_usable || !isfinite(in->current_A) || !(reference_A <= 0.0f) ||
        !isfinite(reference_A)) {
        return (rcbf_decision_t){ .active = RCBF_INVALID };
    }
    const float measured_A = larger(-in->current_A, 0.0f);
    family_heat_t heat = family_heat(family, k, measured_A);
    const float most = 1.0f + k->supply_tolerance;
    float factor = most;
    if (heat.at_most_A < most * family->supply_low_A) {
        factor = larger(1.0f - k->supply_tolerance, heat.at_most_A / family->supply_low_A);
    }
    const float commanded_A = larger(-reference_A, family->supply_high_A);
    const float held_A = larger(heat.at_most_A, commanded_A * (1.0f + k->supply_tolerance));
    const float drift_V = k->hold_s * (family_rise_V_per_s(family, k, held_A) +
                                       k->rest_drift_per_s * family->rest_polarisation_V) +
                          family->ocv_slope_V * k->hold_soc_per_A * held_A;
    const float above_V = family->steadied_V + drift_V;
    const float room_V = cell->max_voltage_V - in->voltage_V - k->voltage_error_V - above_V;
    heat.overpotential_V += above_V;
    const float sure_V = room_V - k->current_error_A * heat.resistance_ohm;
    const float voltage_A =
        measured_A + sure_V / ((sure_V >= 0.0f) ? heat.resistance_ohm : heat.least_resistance_ohm);

    float strength_A = -reference_A * factor;
    rcbf_active_t active = RCBF_NONE;
    weaken(&strength_A, &active,
           family_mapped_A(&k->map, in->surface_temperature_K - k->surface_error_K,
                           family->soc_high.soc),
           RCBF_MAP);
    weaken(&strength_A, &active, voltage_A, RCBF_VOLTAGE);
    if (!family->core_is_known) {
        strength_A = -1.0f;
        active = RCBF_CORE_UNKNOWN;
    }
    const float limit_K = cell->max_core_temperature_K.high_K;
    const float room_K = family_core_room_K(family, k, cell, in);
    const float surface_room_K = (limit_K - in->surface_temperature_K) +
                                 cell->max_core_temperature_K.low_K - k->surface_error_K;
    const float coolant_room_K = (limit_K - in->coolant_temperature_K) - k->coolant_error_K -
                                 k->inner_K;
    if ((strength_A >= 0.0f) && !((room_K >= 0.0f) && (coolant_room_K >= 0.0f))) {
        strength_A = -1.0f;
        active = RCBF_CORE;
    }
    const float outflow_W = k->outflow_W_per_K * (surface_room_K - room_K) +
                            k->gain_W_per_K * (room_K - k->inner_K) - k->disturbance_W - k->hold_W;
    const float slope = family->entropic_V + k->disturbance_W_per_A;
    const float square = k->disturbance_W_per_A2;
    if (strength_A >= 0.0f) {
        weaken(&strength_A, &active,
               larger(family_measured_strength_A(&heat, square, slope, outflow_W),
                      family_assumed_strength_A(&heat, square, slope, outflow_W)),
               RCBF_CORE);
    }
    float allowed_A = (strength_A >= 0.0f) ? strength_A : 0.0f;
    if (at_A != NULL) {
        allowed_A = -*at_A * factor;
    }
    const float heat_W = smaller(family_measured_heat_W(&heat, allowed_A),
                                 family_assumed_heat_W(&heat, allowed_A));
    const float left_W = outflow_W - heat_W - allowed_A * (slope + allowed_A * square);
    return (rcbf_decision_t){
        .current_A = -allowed_A / factor,
        .feasible = strength_A >= 0.0f,
        .active = active,
        .lower_A = -allowed_A / factor,
        .margins = { room_V - heat.resistance_ohm * (allowed_A - measured_A), NAN,
                     k->core_K_per_J * left_W, NAN },
    };
}

rcbf_decision_t plain_family_decision(const family_t *family, const family_constants_t *constants,
                                      const rcbf_constants_t *cell, const family_reading_t *in,
                                      float reference_A)
{
    return decided(family, constants, cell, in, reference_A, NULL);
}

float plain_family_core_left(const family_t *family, const family_constants_t *constants,
                             const rcbf_constants_t *cell, const family_reading_t *in,
                             float reference_A, float current_A)
{
    return decided(family, constants, cell, in, reference_A, &current_A).margins[2];
}
