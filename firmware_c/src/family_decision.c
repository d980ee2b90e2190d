#include "family.h"

#include <math.h>

#include "family_tables.h"
#include "numeric.h"

/* Strongest current that can flow until the end of the hold. */
NUMERIC_INLINE float strongest_in_hold_A(const family_t *family,
                                         const family_constants_t *constants, float measured_A,
                                         float wanted_A)
{
    const float commanded_A = numeric_larger(wanted_A, family->supply_high_A);
    return numeric_larger(measured_A, commanded_A * (1.0f + constants->supply_tolerance));
}

/* Rise of the voltage at a held current within the hold: charge, and branches that fill up. */
NUMERIC_INLINE float drift_V(const family_t *family, const family_constants_t *constants,
                             float strength_A)
{
    return constants->hold_s *
               (family_rise_V_per_s(family, constants, strength_A) +
                constants->rest_drift_per_s * family->rest_polarisation_V) +
           family->ocv_slope_V * constants->hold_soc_per_A * strength_A;
}

/* How much more than asked for the charger gives, at most: by tolerance, or as far as the measured
 * current shows it. */
NUMERIC_INLINE float supply_factor(const family_t *family, const family_constants_t *constants,
                                   float measured_A)
{
    const float most = 1.0f + constants->supply_tolerance;
    const float least = 1.0f - constants->supply_tolerance;
    if (!(measured_A < most * family->supply_low_A)) {
        return most;
    }
    return numeric_larger(least, measured_A / family->supply_low_A);
}

NUMERIC_INLINE float voltage_strength_A(const family_constants_t *constants,
                                        const family_heat_t *heat, float measured_A, float room_V)
{
    const float sure_V = room_V - constants->current_error_A * heat->resistance_ohm;
    return measured_A + sure_V / ((sure_V >= 0.0f) ? heat->resistance_ohm
                                                   : heat->least_resistance_ohm);
}

typedef struct {
    float room_K;    /* from the hottest core that is possible to the limit */
    float outflow_W; /* what the heat must not exceed */
    float slope_W_per_A;
    float square_ohm;
} core_condition_t;

/* Outflow at the hottest core that is possible, and what its distance from the limit adds. */
NUMERIC_INLINE core_condition_t core_condition(const family_t *family,
                                               const family_constants_t *constants,
                                               const rcbf_constants_t *cell,
                                               const family_reading_t *reading)
{
    const float limit_K = cell->max_core_temperature_K.high_K;
    const float low_K = cell->max_core_temperature_K.low_K;
    const float surface_room_K =
        (limit_K - reading->surface_temperature_K) + low_K - constants->surface_error_K;
    const float room_K = family_core_room_K(family, constants, cell, reading);
    return (core_condition_t){
        .room_K = room_K,
        .outflow_W = constants->outflow_W_per_K * (surface_room_K - room_K) +
                     constants->gain_W_per_K * (room_K - constants->inner_K) -
                     constants->disturbance_W - constants->hold_W,
        .slope_W_per_A = family->entropic_V + constants->disturbance_W_per_A,
        .square_ohm = constants->disturbance_W_per_A2,
    };
}

NUMERIC_INLINE float left_W(const core_condition_t *core, float heat_W, float strength_A)
{
    return core->outflow_W - heat_W -
           strength_A * (core->slope_W_per_A + strength_A * core->square_ohm);
}

/* Either bound on the heat is proof enough. */
static float core_left_W(const core_condition_t *core, const family_heat_t *heat, float strength_A)
{
    return left_W(core,
                  numeric_smaller(family_measured_heat_W(heat, strength_A),
                          family_assumed_heat_W(heat, strength_A)),
                  strength_A);
}

NUMERIC_INLINE float core_strength_A(const core_condition_t *core, const family_heat_t *heat)
{
    return numeric_larger(family_measured_strength_A(heat, core->square_ohm, core->slope_W_per_A,
                                             core->outflow_W),
                  family_assumed_strength_A(heat, core->square_ohm, core->slope_W_per_A,
                                            core->outflow_W));
}

/* 0 A in place of what is none, or no number. */
NUMERIC_INLINE float allowed(float strength_A)
{
    return (strength_A >= 0.0f) ? strength_A : 0.0f;
}

rcbf_decision_t family_decide(const family_t *family, const family_constants_t *constants,
                              const rcbf_constants_t *cell, const family_reading_t *reading,
                              float reference_current_A)
{
    if (!reading->is_usable || !numeric_is_finite(reading->current_A) ||
        !(reference_current_A <= 0.0f) || !(reference_current_A >= -FLT_MAX)) {
        return (rcbf_decision_t){ .active = RCBF_INVALID };
    }
    const float measured_A = numeric_larger(-reading->current_A, 0.0f);
    family_heat_t heat = family_heat(family, constants, measured_A);
    const float factor = supply_factor(family, constants, heat.at_most_A);
    const float held_A =
        strongest_in_hold_A(family, constants, heat.at_most_A, -reference_current_A);
    const float drifting_V = drift_V(family, constants, held_A);
    const float above_reading_V = family->steadied_V + drifting_V;
    const float room_V =
        cell->max_voltage_V - reading->voltage_V - constants->voltage_error_V - above_reading_V;
    heat.overpotential_V += above_reading_V;

    float strength_A = -reference_current_A * factor;
    rcbf_active_t active = RCBF_NONE;
    const float mapped_A = family_mapped_A(
        &constants->map, reading->surface_temperature_K - constants->surface_error_K,
        family->soc_high.soc);
    if (!(strength_A <= mapped_A)) {
        strength_A = mapped_A;
        active = RCBF_MAP;
    }
    const float voltage_A = voltage_strength_A(constants, &heat, measured_A, room_V);
    if (!(strength_A <= voltage_A)) {
        strength_A = voltage_A;
        active = RCBF_VOLTAGE;
    }
    if (!family->core_is_known) {
        strength_A = -1.0f;
        active = RCBF_CORE_UNKNOWN;
    }
    const core_condition_t core = core_condition(family, constants, cell, reading);
    const float coolant_room_K =
        (cell->max_core_temperature_K.high_K - reading->coolant_temperature_K) -
        constants->coolant_error_K - constants->inner_K;
    if ((strength_A >= 0.0f) && !((core.room_K >= 0.0f) && (coolant_room_K >= 0.0f))) {
        /* A core that may be too hot waits, though it would cool down with a little current too;
         * beside a coolant that is too hot it would not. */
        strength_A = -1.0f;
        active = RCBF_CORE;
    }
    float allowed_A = allowed(strength_A);
    float left_at_W = core_left_W(&core, &heat, allowed_A);
    if ((strength_A >= 0.0f) && !(left_at_W >= 0.0f)) {
        const float core_A = core_strength_A(&core, &heat);
        if (!(strength_A <= core_A)) {
            strength_A = core_A;
            active = RCBF_CORE;
            allowed_A = allowed(strength_A);
            left_at_W = core_left_W(&core, &heat, allowed_A);
        }
    }
    const float current_A = -allowed_A / factor;
    return (rcbf_decision_t){
        .current_A = current_A,
        .feasible = strength_A >= 0.0f,
        .active = active,
        .lower_A = current_A,
        .margins = { room_V - heat.resistance_ohm * (allowed_A - measured_A), NAN,
                     constants->core_K_per_J * left_at_W, NAN },
    };
}
