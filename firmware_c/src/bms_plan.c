#include "bms_plan.h"

#include <math.h>

#include "bms_symptoms.h"
#include "family_tables.h"
#include "numeric.h"

/* As soon as possible. */
#define NO_TIME_LEFT_S (-1.0f)
/* By which the time that is left may differ from the one that a plan has counted down. */
#define OTHER_TIME_S 120.0f

/* A charger that says nothing of modes is charged as soon as possible. */
static uint8_t asked_mode(const bms_t *bms)
{
    return is_valid(bms, CAN_RECEIVED_CHARGE_MODE) ? bms->measurement.mode
                                                   : (uint8_t)MODE_FASTEST;
}

bool bms_has_planned_mode(const bms_t *bms)
{
    const uint8_t mode = asked_mode(bms);
    return (mode == MODE_FASTEST) || (mode == MODE_BY_TIME);
}

static float time_left_s(const bms_t *bms)
{
    return (asked_mode(bms) == MODE_BY_TIME) ? bms->measurement.time_to_full_s : NO_TIME_LEFT_S;
}

/* Of the cell at hand are known its hottest core and its greatest heat, which its limits go by, and
 * between which bounds its charge and resistance are. */
static void describe_family(const bms_t *bms, planner_start_t *start)
{
    const rcbf_constants_t *cell = &bms->calibration->rcbf;
    const family_constants_t *known = &bms->calibration->family;
    const family_t *family = &bms->family;
    const float voltage_V = bms->measurement.voltage_V;
    const float most_A = family->strength_A + known->current_error_A;
    const float greatest_ohm = family->resistance_ohm + known->polarisation_ohm;
    const float error_V =
        known->voltage_error_V + known->ocv_error_V + known->rest_polarisation_V;
    start->temperature_K[0] = -family->core_room_K;
    start->entropic_V = family->entropic_V;
    start->family_resistance_ohm = family->resistance_ohm;
    /* Without current the heat says nothing of the resistance. */
    start->resistance_ohm = numeric_smaller(
        (family->heat_W / most_A - family->entropic_V) / most_A, greatest_ohm);
    if (asked_mode(bms) == MODE_BY_TIME) {
        /* In time is what even the least full of the largest cells is. */
        start->soc = family->soc_low.soc;
        start->total_ohm = start->resistance_ohm;
        return;
    }
    start->soc = numeric_larger(
        0.5f * (family->soc_low.soc + family->soc_high.soc),
        family_soc_at(cell, voltage_V - error_V - greatest_ohm * most_A));
    start->soc_per_As =
        0.5f * (known->least_soc_per_A + known->greatest_soc_per_A) / known->period_s;
    start->total_ohm = numeric_clamp(
        (voltage_V - rcbf_open_circuit_voltage_V(cell, start->soc)) / most_A,
        known->least_resistance_ohm, greatest_ohm);
}

static void describe(const bms_t *bms, planner_start_t *start, planner_goal_t *goal)
{
    const codec_measurement_t *m = &bms->measurement;
    const bms_calibration_t *calibration = bms->calibration;
    const float core_K = bms->estimate.core_temperature_K;
    const float limit_K = calibration->rcbf.max_core_temperature_K.high_K;
    start->temperature_K[0] = core_K - limit_K;
    start->temperature_K[1] = bms->surface_temperature_K - limit_K;
    start->temperature_K[2] = m->coolant_temperature_K - limit_K;
    start->soc = bms->soc.soc;
    start->soc_per_As = 1.0f / calibration->rcbf.capacity_As;
    start->strength_A = -bms->command_A - 0.5f * calibration->planner.growth_A;
    start->cooling_power_W = m->cooling_power_W;
    start->resistance_ohm = calibration->thermal.ohmic_resistance_ohm;
    start->total_ohm = start->resistance_ohm;
    start->entropic_V = calibration->thermal.entropic_coefficient_V_per_K * core_K;
    if (has_family(bms)) {
        describe_family(bms, start);
    }
    goal->strongest_A = -m->reference_current_A;
    if (goal->strongest_A > -calibration->reference_current_A) {
        goal->strongest_A = -calibration->reference_current_A;
    }
    goal->time_left_s = time_left_s(bms);
}

static bool is_other_goal(const bms_t *bms)
{
    const float planned_s = bms->planner.goal.time_left_s;
    const float asked_s = time_left_s(bms);
    if ((planned_s < 0.0f) || (asked_s < 0.0f)) {
        return (planned_s < 0.0f) != (asked_s < 0.0f);
    }
    return !(fabsf(asked_s - (planned_s - bms->planner.age_s)) <= OTHER_TIME_S);
}

void bms_plan(bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    if (!is_charging(bms) || !bms_has_planned_mode(bms)) {
        planner_reset(&bms->planner);
        return;
    }
    if (is_other_goal(bms)) {
        planner_reset(&bms->planner);
    }
    if (planner_is_due(&bms->planner)) {
        describe(bms, &bms->planner.start, &bms->planner.goal);
        planner_begin(&bms->planner);
    }
    planner_step(&bms->planner, &calibration->planner, &calibration->rcbf, &calibration->family);
}
