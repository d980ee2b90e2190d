/* What follows from the bounds: whether the cell is full, and whether the readings can be true. */
#include "family.h"
#include "family_tables.h"

bool family_is_full(const family_t *family, const family_constants_t *constants,
                    float completion_soc)
{
    return (family->soc_known && (family->soc_low.soc >= completion_soc)) ||
           (family->full_count >= constants->full_periods);
}

float family_core_room_K(const family_t *family, const family_constants_t *constants,
                         const rcbf_constants_t *cell, const family_reading_t *reading)
{
    const float estimated_room_K =
        (cell->max_core_temperature_K.high_K - reading->estimated_core_K) +
        cell->max_core_temperature_K.low_K - constants->estimate_error_K;
    /* An estimate that is no number leaves what the observer knows. */
    return (estimated_room_K > family->core_room_K) ? estimated_room_K : family->core_room_K;
}

bool family_is_too_hot(const family_t *family, const family_constants_t *constants,
                       const rcbf_constants_t *cell, const family_reading_t *reading,
                       float overshoot_K)
{
    return family->core_is_known && (-reading->current_A > 2.0f * constants->current_error_A) &&
           (family_core_room_K(family, constants, cell, reading) < -overshoot_K);
}

bool family_supply_is_plausible(const family_t *family, const family_constants_t *constants,
                                float current_A, float deviation_A)
{
    const float strength_A = -current_A;
    const float low_A = family->supply_low_A * (1.0f - constants->supply_tolerance);
    const float high_A = family->supply_high_A * (1.0f + constants->supply_tolerance);
    return (strength_A >= low_A - deviation_A) && (strength_A <= high_A + deviation_A);
}

bool family_voltage_is_plausible(const family_t *family, const family_constants_t *constants,
                                 const rcbf_constants_t *cell, const family_reading_t *reading,
                                 float deviation_V)
{
    const float strength_A = (reading->current_A < 0.0f) ? -reading->current_A : 0.0f;
    const float less_A = strength_A - constants->current_error_A;
    const float at_least_A = (less_A > 0.0f) ? less_A : 0.0f;
    const float at_most_A = strength_A + constants->current_error_A;
    const float spread_V = constants->ocv_error_V + family->rest_polarisation_V + deviation_V;
    const float low_V = rcbf_open_circuit_voltage_V(cell, family->soc_low.soc) +
                        constants->least_resistance_ohm * at_least_A - spread_V;
    const float high_V = rcbf_open_circuit_voltage_V(cell, family->soc_high.soc) +
                         family->resistance_ohm * at_most_A +
                         family->polarisation_V + spread_V;
    return (reading->voltage_V >= low_V) && (reading->voltage_V <= high_V);
}
