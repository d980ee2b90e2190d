#include "pack_function.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

#include "numeric.h"
#include "pack_cell.h"

/* Halvings of the strongest current that is ever allowed: to 1/4096 of it. */
#define HALVINGS 12u

static bool horizon_is_valid(const pack_horizon_t *horizon)
{
    const float numbers[] = {
        horizon->core_above_estimate_K, horizon->core_K_per_W,
        horizon->core_K,                horizon->surface_per_core,
        horizon->surface_per_coolant,   horizon->surface_per_warmer_coolant,
        horizon->surface_K,             horizon->coolant_per_core,
        horizon->coolant_per_surface,   horizon->coolant_K,
    };
    bool is_valid = (horizon->horizon_s > 0.0f) && (horizon->horizon_s <= FLT_MAX);
    for (uint32_t i = 0u; i < NUMERIC_COUNT(numbers); i++) {
        is_valid = is_valid && numeric_is_within(numbers[i], 0.0f, FLT_MAX);
    }
    return is_valid;
}

/* NaN stays. */
static float more_of(float a, float b)
{
    if (a >= b) {
        return a;
    }
    return (b > a) ? b : NAN;
}

pack_worst_t pack_worst(const pack_t *pack)
{
    pack_worst_t worst = { -FLT_MAX, -FLT_MAX, -FLT_MAX,
                           more_of(pack->coolant_in_K, pack->coolant_out_K) };
    for (uint32_t i = 0u; i < pack->cells; i++) {
        const pack_cell_t *cell = &pack->cell[i];
        worst.soc = more_of(worst.soc, cell->soc.soc);
        worst.surface_K = more_of(worst.surface_K, cell->surface_temperature_K);
        worst.estimate_K = more_of(worst.estimate_K, cell->estimate.core_temperature_K);
    }
    return worst;
}

/* Hottest that a surface becomes while cores are no hotter than `core_K`. At the hottest surface of
 * the pack neighbours only cool. */
static float hottest_surface_K(const pack_horizon_t *horizon, const pack_worst_t *worst, float core_K)
{
    const float surface_K = worst->surface_K + horizon->surface_K;
    const float now_K = worst->coolant_K + horizon->coolant_K;
    const float by_core_K = horizon->coolant_per_core * (core_K - now_K);
    const float by_surface_K = horizon->coolant_per_surface * (surface_K - now_K);
    const float coolant_K = now_K + more_of(more_of(by_core_K, by_surface_K), 0.0f);
    const float share = (coolant_K > surface_K) ? horizon->surface_per_warmer_coolant
                                                : horizon->surface_per_coolant;
    const float end_K = surface_K + horizon->surface_per_core * (core_K - surface_K) +
                        share * (coolant_K - surface_K);
    return more_of(surface_K, end_K);
}

/* Whether the worst cell keeps its limits while a current of this strength is held. Its core does
 * where at the limit itself no less flows to the surface than the heat brings, with the hottest
 * surface that comes; it need not be known how hot the core is. */
static bool admits(const pack_t *pack, const pack_horizon_t *horizon, const pack_worst_t *worst,
                   float strength_A)
{
    const bms_calibration_t *calibration = pack->calibration;
    const rcbf_constants_t *k = &calibration->rcbf;
    const float limit_K = k->max_core_temperature_K.high_K;
    const float reversible_V = fabsf(calibration->thermal.entropic_coefficient_V_per_K) * limit_K;
    const float heat_W = (k->ohmic_resistance_ohm * strength_A + reversible_V) * strength_A;
    const float warmed_K = worst->estimate_K + horizon->core_above_estimate_K + horizon->core_K +
                           horizon->core_K_per_W * heat_W;
    const float core_K = more_of((warmed_K >= limit_K) ? limit_K : warmed_K,
                                 worst->surface_K + horizon->surface_K);
    const float surface_K = hottest_surface_K(horizon, worst, core_K);
    const float core_left_K_per_s =
        k->a1_per_s * (limit_K - surface_K) -
        (k->core_uncertainty_K_per_s + k->core_margin_K_per_s) -
        (fabsf(k->a2_per_As) * limit_K + k->a3_K_per_A2s * strength_A) * strength_A;
    const float soc = worst->soc + calibration->soc_error +
                      horizon->horizon_s *
                          (strength_A / k->capacity_As + k->soc_uncertainty_per_s);
    const float voltage_V = rcbf_open_circuit_voltage_V(k, soc) + k->voltage_margin_V +
                            k->ohmic_resistance_ohm * strength_A;
    return (core_left_K_per_s >= 0.0f) && (surface_K <= k->max_surface_temperature_K.high_K) &&
           (soc <= k->max_soc) && (voltage_V <= k->max_voltage_V);
}

static bool may_charge(const pack_t *pack)
{
    return (pack->calibration != NULL) && !pack_has_family(pack) && pack->soc_known &&
           !pack->monitor.stop && (pack->monitor.latched == 0u) &&
           ((pack->state == BMS_STANDBY) || pack_is_charging(pack));
}

float pack_function_A(const pack_t *pack, const pack_worst_t *worst,
                      const pack_horizon_t *horizon)
{
    if (!may_charge(pack) || !horizon_is_valid(horizon)) {
        return 0.0f;
    }
    float refused_A = -pack->calibration->reference_current_A;
    if (admits(pack, horizon, worst, refused_A)) {
        return -refused_A;
    }
    /* What is returned has itself been found to be admitted, whatever lies between. */
    float admitted_A = 0.0f;
    for (uint32_t i = 0u; i < HALVINGS; i++) {
        const float middle_A = 0.5f * (admitted_A + refused_A);
        if (admits(pack, horizon, worst, middle_A)) {
            admitted_A = middle_A;
        } else {
            refused_A = middle_A;
        }
    }
    return -admitted_A;
}
