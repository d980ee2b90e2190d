/* What the surface tells of the core over some periods. */
#include "family.h"
#include "family_tables.h"
#include "numeric.h"

static void add_to(family_window_t *window, const family_reading_t *reading)
{
    const float surface_K = reading->surface_temperature_K;
    if (window->count == 0u) {
        *window = (family_window_t){ .first_K = surface_K };
    }
    window->count++;
    window->sum_K += surface_K - window->first_K;
    window->gap_K += surface_K - reading->coolant_temperature_K;
}

/* The surface's own balance tells the mean of the core over a time:
 *   Tc - Ts = Rc Cs (Ts' - nu) + (Rc / Rs) (Ts - Tinf)
 * and a core without current is no hotter than its mean, unless the surface is hotter still. */
void family_look_at_rest(family_t *family, const family_constants_t *constants,
                         const rcbf_constants_t *cell, const family_reading_t *reading)
{
    family_window_t *window = &family->rest;
    const float surface_K = reading->surface_temperature_K;
    add_to(window, reading);
    if (window->count < constants->rest_periods) {
        return;
    }
    const float share = 1.0f / (float)window->count;
    const float mean_K = window->first_K + share * window->sum_K;
    const float above_K =
        numeric_larger(0.0f, surface_K - window->first_K) * constants->per_surface_rise +
        numeric_larger(0.0f, share * window->gap_K) * constants->per_coolant_gap;
    const float heated_K = (float)window->count * constants->heating_K_per_W * family->heat_W;
    const float hottest_K =
        numeric_larger(surface_K, mean_K + above_K) + constants->rest_error_K + numeric_larger(0.0f, heated_K);
    const float room_K = (cell->max_core_temperature_K.high_K - hottest_K) +
                         cell->max_core_temperature_K.low_K;
    if (!family->core_is_known || (room_K > family->core_room_K)) {
        family->core_room_K = room_K;
        family->core_is_known = numeric_is_finite(room_K);
    }
    window->count = 0u;
}

/* A surface that says that the core is hotter than the measured heat can have made it contradicts
 * the voltage or itself. The hotter one is believed. */
void family_look_in_charge(family_t *family, const family_constants_t *constants,
                           const rcbf_constants_t *cell, const family_reading_t *reading)
{
    family_window_t *window = &family->charge;
    add_to(window, reading);
    if (window->count < constants->charge_periods) {
        return;
    }
    const float share = 1.0f / (float)window->count;
    const float rise_K = reading->surface_temperature_K - window->first_K;
    const float per_rise = (rise_K > 0.0f) ? constants->least_per_surface_rise
                                           : constants->most_per_surface_fall;
    const float gap_K = share * window->gap_K;
    const float least_K = window->first_K + share * window->sum_K + rise_K * per_rise +
                          gap_K * constants->least_per_coolant_gap - constants->charge_error_K;
    const float room_K = (cell->max_core_temperature_K.high_K - least_K) +
                         cell->max_core_temperature_K.low_K;
    if ((gap_K > 0.0f) && (room_K < family->core_room_K)) {
        family->core_room_K = room_K;
    }
    window->count = 0u;
}
