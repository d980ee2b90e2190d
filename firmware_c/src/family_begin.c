#include "family.h"

#include <math.h>

#include "family_tables.h"
#include "numeric.h"

bool family_is_at_rest(const family_constants_t *constants, const family_reading_t *reading)
{
    return fabsf(reading->current_A) <= 2.0f * constants->current_error_A;
}

void family_begin(family_t *family, const family_constants_t *constants,
                  const rcbf_constants_t *cell, float plug_in_soc,
                  const family_reading_t *reading)
{
    const float told_low = numeric_clamp(plug_in_soc - constants->plug_in_error, 0.0f, 1.0f);
    const float told_high = numeric_clamp(plug_in_soc + constants->plug_in_error, 0.0f, 1.0f);
    float low = told_low;
    float high = told_high;
    if (family_is_at_rest(constants, reading)) {
        /* A charge that has just ended has left polarisation as well, which does not lower the
         * voltage. */
        const float error_V = constants->voltage_error_V + constants->ocv_error_V +
                              constants->rest_polarisation_V +
                              3.0f * constants->current_error_A * constants->resistance_ohm[0];
        const float seen_low =
            family_soc_at(cell, reading->voltage_V - error_V - family->polarisation_V);
        const float seen_high = family_soc_at(cell, reading->voltage_V + error_V);
        low = numeric_larger(told_low, seen_low);
        high = numeric_smaller(told_high, seen_high);
        if (low > high) {
            /* One of both is wrong; nobody knows which. */
            low = numeric_smaller(told_low, seen_low);
            high = numeric_larger(told_high, seen_high);
        }
    }
    family->soc_low = (soc_counter_t){ low, 0.0f };
    family->soc_high = (soc_counter_t){ high, 0.0f };
    family->soc_known = true;
    family->rest_polarisation_V = constants->rest_polarisation_V;
    family->full_count = 0u;
}
