#include "thermal.h"

#include <stddef.h>

#include "numeric.h"

/* From the first of them to the bound on the error. */
#define NUMBERS \
    ((uint16_t)(offsetof(thermal_constants_t, error_bound_K) / sizeof(float)))

bool thermal_constants_are_valid(const thermal_constants_t *constants)
{
    static const numeric_field_t FIELDS[] = {
        { (uint16_t)offsetof(thermal_constants_t, transition), NUMBERS, -FLT_MAX, FLT_MAX },
        { (uint16_t)offsetof(thermal_constants_t, error_bound_K), 1u, 0.0f, FLT_MAX },
    };
    return numeric_fields_are_within(constants, FIELDS, NUMERIC_COUNT(FIELDS));
}

void thermal_reset(thermal_t *thermal)
{
    *thermal = (thermal_t){ .is_known = false };
}

void thermal_step(thermal_t *thermal, const thermal_constants_t *constants, float current_A,
                  float surface_temperature_K, float coolant_temperature_K)
{
    if (!thermal->is_known) {
        thermal->is_known = true;
        thermal->start_K = surface_temperature_K;
        return;
    }
    const float core_K = thermal->start_K + thermal->core_rise_K;
    const float heat_W = (constants->ohmic_resistance_ohm * current_A -
                          constants->entropic_coefficient_V_per_K * core_K) *
                         current_A;
    const float coolant_rise_K = coolant_temperature_K - thermal->start_K;
    const float core_rise_K = thermal->core_rise_K;
    const float surface_rise_K = thermal->surface_rise_K;
    thermal->core_rise_K = constants->transition[0] * core_rise_K +
                           constants->transition[1] * surface_rise_K +
                           constants->gain_K_per_W[0] * heat_W +
                           constants->gain_coolant[0] * coolant_rise_K;
    thermal->surface_rise_K = constants->transition[2] * core_rise_K +
                              constants->transition[3] * surface_rise_K +
                              constants->gain_K_per_W[1] * heat_W +
                              constants->gain_coolant[1] * coolant_rise_K;
}

float thermal_predicted_surface_K(const thermal_t *thermal)
{
    return thermal->is_known ? (thermal->start_K + thermal->surface_rise_K) : -FLT_MAX;
}

float thermal_coldest_surface_K(const thermal_t *thermal, const thermal_constants_t *constants)
{
    return thermal_predicted_surface_K(thermal) - constants->error_bound_K;
}
