#include "calibration.h"

#include "numeric.h"

#define SHORTEST_PERIOD_S 0.001f
#define LONGEST_PERIOD_S 10.0f

static bool range_is_valid(const range_t *range)
{
    return numeric_is_finite(range->low) && numeric_is_finite(range->high) &&
           (range->low < range->high);
}

static bool is_positive(float value)
{
    return (value > 0.0f) && numeric_is_finite(value);
}

static bool plausibility_is_valid(const plausibility_t *limits)
{
    return range_is_valid(&limits->current_A) && range_is_valid(&limits->voltage_V) &&
           range_is_valid(&limits->surface_temperature_K) &&
           range_is_valid(&limits->coolant_temperature_K) &&
           range_is_valid(&limits->cooling_power_W) && is_positive(limits->current_deviation_A) &&
           is_positive(limits->voltage_deviation_V) && is_positive(limits->voltage_overshoot_V) &&
           is_positive(limits->temperature_overshoot_K) &&
           is_positive(limits->surface_deficit_K) &&
           numeric_all_finite(limits->reading_error, KAN_MEASURED_INPUTS);
}

/* Ports step by a clock of whole milliseconds. */
static bool period_is_valid(float sampling_period_s)
{
    return (sampling_period_s >= SHORTEST_PERIOD_S) && (sampling_period_s <= LONGEST_PERIOD_S);
}

bool calibration_is_valid(const bms_calibration_t *calibration)
{
    return (calibration->layout == BMS_CALIBRATION_LAYOUT) &&
           period_is_valid(calibration->sampling_period_s) &&
           is_positive(-calibration->reference_current_A) &&
           is_positive(calibration->current_growth_A) &&
           is_positive(calibration->completion_soc) &&
           rcbf_constants_are_valid(&calibration->rcbf) &&
           plausibility_is_valid(&calibration->plausibility) &&
           thermal_constants_are_valid(&calibration->thermal) &&
           family_constants_are_valid(&calibration->family) &&
           planner_constants_are_valid(&calibration->planner) &&
           (calibration->kan.width[0] == KAN_MEASURED_INPUTS + calibration->kan.lags) &&
           kan_model_is_valid(&calibration->kan);
}
