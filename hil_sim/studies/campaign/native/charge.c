#include "charge.h"

#include <math.h>

#define KNOT_WIDTH 4

void charge_begin(charge_t *charge, const bms_calibration_t *calibration)
{
    const bms_config_t config = { .calibration = calibration };
    const cell_state_t *start = &charge->state;
    bms_init(&charge->link.bms, &config);
    charge->plug_in_soc = start->soc;
    charge->outcome = CHARGE_RUNNING;
    charge->first_derate_s = -1.0;
    charge->first_fault = FAULT_NONE;
    charge->surface_error_K_per_s = NAN;
    charge->peaks = (charge_peaks_t){
        .core_temperature_K = start->core,
        .surface_temperature_K = start->surface,
        .voltage_V = cell_terminal_voltage_V(&charge->cell, start->soc, charge->current_A),
        .soc = start->soc,
    };
}

static void measure(const charge_t *charge, const double *normals, double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = charge->scenario;
    const double truth[LINK_READINGS] = {
        charge->current_A,
        cell_terminal_voltage_V(&charge->cell, charge->state.soc, charge->current_A),
        charge->state.surface,
        charge->state.coolant,
        charge->cooling_power_W,
    };
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        const charge_sensor_t *sensor = &scenario->sensors[i];
        const double normal =
            fmin(fmax(normals[i], -scenario->noise_cutoff), scenario->noise_cutoff);
        const double value = truth[i] + sensor->bias + sensor->noise_std * normal;
        readings[i] = (sensor->resolution == 0.0)
                          ? value
                          : sensor->resolution * rint(value / sensor->resolution);
    }
}

static void note_firmware(charge_t *charge, uint32_t state)
{
    const bms_t *bms = &charge->link.bms;
    if (bms->monitor.first != FAULT_NONE) {
        charge->first_fault = bms->monitor.first;
    }
    if (!charge->requested) {
        return;
    }
    const double error_K = fabs((double)bms->estimate.core_temperature_K - charge->state.core);
    charge->peaks.estimate_error_K = fmax(charge->peaks.estimate_error_K, error_K);
    if (((state == BMS_CHARGING) || (state == BMS_DERATED)) && !bms->decision.feasible) {
        charge->infeasible_periods++;
    }
}

static link_answer_t ask_firmware(charge_t *charge, const double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = charge->scenario;
    const link_answer_t answer =
        link_exchange(&charge->link, &scenario->signals, readings, charge->requested,
                      scenario->reference_current_A, charge->plug_in_soc);
    note_firmware(charge, answer.state);
    return answer;
}

/* Counts the charge and says whether the controller takes the cell for full. */
static bool is_full(charge_t *charge, double reading_A)
{
    const charge_scenario_t *scenario = charge->scenario;
    if (charge->controller == CHARGE_S_CBF) {
        return charge->state.soc >= scenario->completion_soc;
    }
    if (charge->periods == charge->edge_period) {
        charge->counted_soc = link_over_the_bus(&scenario->signals.plug_in_soc, charge->plug_in_soc);
    }
    const double share_per_A = scenario->period_s / scenario->baselines.capacity_As;
    charge->counted_soc -= reading_A * share_per_A;
    return charge->counted_soc >= scenario->completion_soc;
}

static link_answer_t ask_baseline(charge_t *charge, const double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = charge->scenario;
    const link_signals_t *signals = &scenario->signals;
    const double reference_A =
        link_over_the_bus(&signals->reference_current, scenario->reference_current_A);
    double heard[LINK_READINGS];
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        heard[i] = link_over_the_bus(&signals->readings[i], readings[i]);
    }
    link_answer_t answer = { true, 0.0, BMS_STANDBY };
    if (charge->requested && is_full(charge, heard[0])) {
        answer.state = BMS_COMPLETE;
    } else if (charge->requested) {
        const double current_A =
            (charge->controller == CHARGE_S_CBF)
                ? baseline_s_cbf_A(&scenario->baselines, &scenario->nominal, &charge->state,
                                   charge->cooling_power_W, reference_A)
                : baseline_cc_cv_A(&scenario->baselines, heard[0], heard[1], heard[2], reference_A);
        answer.state = (current_A == reference_A) ? BMS_CHARGING : BMS_DERATED;
        answer.command_A = link_over_the_bus(&signals->command_current, current_A);
    }
    return answer;
}

static charge_outcome_t outcome_of(const charge_t *charge, uint32_t state)
{
    const charge_scenario_t *scenario = charge->scenario;
    if (!charge->requested) {
        const bool is_late = charge->periods >= ((state == BMS_INIT) ? scenario->starting_periods
                                                                     : scenario->ready_periods);
        return (is_late && (state != BMS_STANDBY)) ? CHARGE_NOT_READY : CHARGE_RUNNING;
    }
    if (state == BMS_COMPLETE) {
        return CHARGE_COMPLETE;
    }
    if (state == BMS_FAULT) {
        return CHARGE_FAULT;
    }
    const double run_s = (double)(charge->periods - charge->edge_period) * scenario->period_s;
    return (run_s >= scenario->max_time_s) ? CHARGE_TIME_LIMIT : CHARGE_RUNNING;
}

static double larger_abs(double peak, double value)
{
    return fmax(peak, fabs(value));
}

static void note_model_error(charge_t *charge, const cell_state_t *rates, double step_s)
{
    static const cell_state_t UNDISTURBED = { 0.0, 0.0, 0.0, 0.0 };
    const cell_state_t nominal = cell_rates(&charge->scenario->nominal, &charge->state,
                                            charge->current_A, charge->cooling_power_W,
                                            &UNDISTURBED);
    const double surface_K_per_s = rates->surface - nominal.surface;
    charge_peaks_t *peaks = &charge->peaks;
    cell_state_t *error = &peaks->model_error;
    error->soc = larger_abs(error->soc, rates->soc - nominal.soc);
    error->core = larger_abs(error->core, rates->core - nominal.core);
    error->surface = larger_abs(error->surface, surface_K_per_s);
    error->coolant = larger_abs(error->coolant, rates->coolant - nominal.coolant);
    if (!isnan(charge->surface_error_K_per_s)) {
        peaks->surface_error_slope_K_per_s2 =
            larger_abs(peaks->surface_error_slope_K_per_s2,
                       (surface_K_per_s - charge->surface_error_K_per_s) / step_s);
    }
    charge->surface_error_K_per_s = surface_K_per_s;
}

static void advance_plant(charge_t *charge, const double *knots)
{
    charge_peaks_t *peaks = &charge->peaks;
    const double step_s = charge->scenario->period_s / CHARGE_SUB_STEPS;
    double highest_soc = charge->state.soc;
    for (uint32_t i = 0u; i < CHARGE_SUB_STEPS; i++) {
        const double *end = &knots[i * KNOT_WIDTH];
        const cell_state_t after = { end[0], end[1], end[2], end[3] };
        const cell_state_t rates = cell_rates(&charge->cell, &charge->state, charge->current_A,
                                              charge->cooling_power_W, &charge->knot);
        if (charge->controller == CHARGE_KAN_RCBF) {
            note_model_error(charge, &rates, step_s);
        }
        charge->state = cell_step(&charge->cell, &charge->state, charge->current_A,
                                  charge->cooling_power_W, step_s, &rates, &charge->knot, &after);
        charge->knot = after;
        highest_soc = fmax(highest_soc, charge->state.soc);
        peaks->core_temperature_K = fmax(peaks->core_temperature_K, charge->state.core);
        peaks->surface_temperature_K = fmax(peaks->surface_temperature_K, charge->state.surface);
    }
    peaks->soc = fmax(peaks->soc, highest_soc);
    /* At one current the voltage rises with the state of charge, so its peak is there. */
    peaks->voltage_V = fmax(peaks->voltage_V, cell_terminal_voltage_V(&charge->cell, highest_soc,
                                                                      charge->current_A));
}

static void run_period(charge_t *charge, const double *normals, const double *knots)
{
    const charge_scenario_t *scenario = charge->scenario;
    double readings[LINK_READINGS];
    measure(charge, normals, readings);
    const link_answer_t answer = (charge->controller == CHARGE_KAN_RCBF)
                                     ? ask_firmware(charge, readings)
                                     : ask_baseline(charge, readings);
    charge->current_A =
        answer.intact ? fmin(fmax(answer.command_A, scenario->reference_current_A), 0.0) : 0.0;
    if (charge->requested) {
        charge->time_s = (double)(charge->periods - charge->edge_period) * scenario->period_s;
        if ((answer.state == BMS_DERATED) && (charge->first_derate_s < 0.0)) {
            charge->first_derate_s = charge->time_s;
        }
    }
    charge->periods++;
    charge->outcome = outcome_of(charge, answer.state);
    if (charge->outcome != CHARGE_RUNNING) {
        return;
    }
    if (!charge->requested && (charge->periods >= scenario->off_periods) &&
        (answer.state == BMS_STANDBY)) {
        charge->requested = true;
        charge->edge_period = charge->periods;
    }
    advance_plant(charge, knots);
}

void charge_advance(charge_t *charge, const double *normals, const double *knots, uint32_t periods)
{
    for (uint32_t i = 0u; (i < periods) && (charge->outcome == CHARGE_RUNNING); i++) {
        run_period(charge, &normals[i * LINK_READINGS],
                   &knots[i * CHARGE_SUB_STEPS * KNOT_WIDTH]);
    }
}

void charge_limit_slope(double *knots, uint32_t count, double before, double largest_change)
{
    const uint32_t surface = 2u;
    for (uint32_t i = 0u; i < count; i++) {
        double *knot = &knots[i * KNOT_WIDTH + surface];
        *knot = before + fmin(fmax(*knot - before, -largest_change), largest_change);
        before = *knot;
    }
}
