#include "calibration.h"

#include <stddef.h>

#include "numeric.h"

/* What no calibration exceeds, whatever cell it is for: 0.5 to 300 Ah, 1.5 to 4.5 V, and limits that
 * no lithium-ion cell is charged at. Ports step by a clock of whole milliseconds. */
#define LEAST_OCV_V 0.0f
#define HIGHEST_OCV_V 4.6f
#define LARGEST_READING_ERROR 100.0f

#define WITHIN(member, low, high) { (uint16_t)offsetof(bms_calibration_t, member), 1u, low, high }

static const numeric_field_t ENVELOPE[] = {
    WITHIN(sampling_period_s, 0.001f, 10.0f),
    WITHIN(reference_current_A, -3000.0f, -0.001f),
    WITHIN(current_growth_A, 1e-6f, 3000.0f),
    WITHIN(completion_soc, 0.01f, 1.0f),
    WITHIN(soc_error, 0.0f, 0.5f),
    WITHIN(rcbf.max_core_temperature_K.high_K, 253.0f, 353.0f),
    WITHIN(rcbf.max_surface_temperature_K.high_K, 253.0f, 353.0f),
    WITHIN(rcbf.capacity_As, 1800.0f, 1.08e6f),
    WITHIN(rcbf.max_voltage_V, 1.5f, 4.5f),
    WITHIN(rcbf.max_soc, 0.01f, 1.0f),
    WITHIN(rcbf.estimation_error_bound_K, 0.0f, 30.0f),
    WITHIN(plausibility.current_A.low, -6000.0f, 0.0f),
    WITHIN(plausibility.current_A.high, 0.0f, 6000.0f),
    WITHIN(plausibility.voltage_V.low, 0.0f, 4.5f),
    WITHIN(plausibility.voltage_V.high, 1.5f, 6.5f),
    WITHIN(plausibility.surface_temperature_K.low, 173.0f, 353.0f),
    WITHIN(plausibility.surface_temperature_K.high, 253.0f, 423.0f),
    WITHIN(plausibility.coolant_temperature_K.low, 173.0f, 353.0f),
    WITHIN(plausibility.coolant_temperature_K.high, 253.0f, 423.0f),
    WITHIN(plausibility.current_deviation_A, 1e-6f, 300.0f),
    WITHIN(plausibility.voltage_deviation_V, 1e-6f, 1.0f),
    WITHIN(plausibility.voltage_overshoot_V, 1e-6f, 0.3f),
    WITHIN(plausibility.temperature_overshoot_K, 1e-6f, 10.0f),
    WITHIN(plausibility.surface_deficit_K, 1e-6f, 30.0f),
    WITHIN(plausibility.cooling_power_W.low, -FLT_MAX, FLT_MAX),
    WITHIN(plausibility.cooling_power_W.high, -FLT_MAX, FLT_MAX),
    { (uint16_t)offsetof(bms_calibration_t, plausibility.reading_error), KAN_MEASURED_INPUTS, 0.0f,
      LARGEST_READING_ERROR },
};

/* Both are numbers. */
static bool range_is_valid(const range_t *range)
{
    return range->low < range->high;
}

static bool ranges_are_valid(const plausibility_t *limits)
{
    return range_is_valid(&limits->current_A) && range_is_valid(&limits->voltage_V) &&
           range_is_valid(&limits->surface_temperature_K) &&
           range_is_valid(&limits->coolant_temperature_K) &&
           range_is_valid(&limits->cooling_power_W);
}

/* For a table whose points rise. */
static bool ocv_is_in_envelope(const rcbf_constants_t *cell)
{
    return (cell->ocv_V[0] >= LEAST_OCV_V) &&
           (cell->ocv_V[cell->ocv_points - 1u] <= HIGHEST_OCV_V);
}

bool calibration_is_valid(const bms_calibration_t *calibration)
{
    return (calibration->layout == BMS_CALIBRATION_LAYOUT) &&
           numeric_fields_are_within(calibration, ENVELOPE, NUMERIC_COUNT(ENVELOPE)) &&
           rcbf_constants_are_valid(&calibration->rcbf) &&
           ocv_is_in_envelope(&calibration->rcbf) &&
           ranges_are_valid(&calibration->plausibility) &&
           thermal_constants_are_valid(&calibration->thermal) &&
           family_constants_are_valid(&calibration->family) &&
           planner_constants_are_valid(&calibration->planner) &&
           (calibration->kan.width[0] == KAN_MEASURED_INPUTS + calibration->kan.lags) &&
           kan_model_is_valid(&calibration->kan);
}
