#include "charge.h"

#include <math.h>
#include <stddef.h>

static double larger(double a, double b)
{
    return (a > b) ? a : b;
}

static double within(double value, double low, double high)
{
    return (value < low) ? low : ((value > high) ? high : value);
}

static charge_differences_t differences_of(const cell_t *cell, const cell_t *nominal)
{
    const double core = cell->core_resistance_K_per_W;
    const double surface = cell->surface_resistance_K_per_W;
    const double nominal_core = nominal->core_resistance_K_per_W;
    const double nominal_surface = nominal->surface_resistance_K_per_W;
    return (charge_differences_t){
        .soc_per_As = 1.0 / nominal->capacity_As - 1.0 / cell->capacity_As,
        .core_gap_per_s = 1.0 / (nominal_core * nominal->core_heat_capacity_J_per_K) -
                          1.0 / (core * cell->core_heat_capacity_J_per_K),
        .surface_core_per_s = 1.0 / (core * cell->surface_heat_capacity_J_per_K) -
                              1.0 / (nominal_core * nominal->surface_heat_capacity_J_per_K),
        .surface_gap_per_s = 1.0 / (nominal_surface * nominal->surface_heat_capacity_J_per_K) -
                             1.0 / (surface * cell->surface_heat_capacity_J_per_K),
        .coolant_gap_per_s = 1.0 / (surface * cell->coolant_heat_capacity_J_per_K) -
                             1.0 / (nominal_surface * nominal->coolant_heat_capacity_J_per_K),
        .coolant_K_per_J = 1.0 / nominal->coolant_heat_capacity_J_per_K -
                           1.0 / cell->coolant_heat_capacity_J_per_K,
    };
}

void charge_begin(charge_t *charge, const bms_calibration_t *calibration)
{
    const bms_config_t config = { .calibration = calibration };
    const cell_state_t *start = &charge->memory.state;
    bms_init(&charge->link.bms, &config);
    charge->outcome = CHARGE_RUNNING;
    charge->first_derate_s = -1.0;
    charge->predicted_s = -1.0;
    charge->first_fault = FAULT_NONE;
    charge->surface_error_K_per_s = NAN;
    charge->differences = differences_of(&charge->cell, &charge->scenario->nominal);
    charge->peaks = (charge_peaks_t){
        .cell = {
            .soc = start->soc,
            .core_temperature_K = start->core,
            .surface_temperature_K = start->surface,
            .voltage_V = cell_terminal_voltage_V(&charge->cell, &charge->memory, charge->current_A),
        },
    };
}

static void measure(const charge_t *charge, const double *normals, double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = charge->scenario;
    const double truth[LINK_READINGS] = {
        charge->current_A,
        cell_terminal_voltage_V(&charge->cell, &charge->memory, charge->current_A),
        charge->memory.state.surface,
        charge->memory.state.coolant,
        charge->cooling_power_W,
    };
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        const charge_sensor_t *sensor = &scenario->sensors[i];
        const double normal =
            within(normals[i], -scenario->noise_cutoff, scenario->noise_cutoff);
        const double value = truth[i] + charge->bias[i] + sensor->noise_std * normal;
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
    const double error_K = fabs((double)bms->estimate.core_temperature_K - charge->memory.state.core);
    charge->peaks.estimate_error_K = fmax(charge->peaks.estimate_error_K, error_K);
    if (((state == BMS_CHARGING) || (state == BMS_DERATED)) && !bms->decision.feasible) {
        charge->infeasible_periods++;
    }
}

static link_answer_t ask_firmware(charge_t *charge, const double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = charge->scenario;
    const double run_s =
        charge->requested ? (double)(charge->periods - charge->edge_period) * scenario->period_s
                          : 0.0;
    const bool has_time = scenario->full_by_s >= 0.0;
    const link_request_t asked = {
        .charge = charge->requested,
        .reference_current_A = scenario->reference_current_A,
        .plug_in_soc = charge->plug_in_soc,
        .has_mode = scenario->has_mode,
        .mode = scenario->mode,
        .time_to_full_s = has_time ? fmax(scenario->full_by_s - run_s, 0.0) : -1.0,
    };
    const link_answer_t answer =
        link_exchange(&charge->link, &scenario->signals, readings, &asked);
    charge->predicted_s = answer.predicted_s;
    note_firmware(charge, answer.state);
    return answer;
}

/* Counts the charge and says whether the controller takes the cell for full. */
static bool is_full(charge_t *charge, double reading_A, double reading_V)
{
    const charge_scenario_t *scenario = charge->scenario;
    if (charge->controller == CHARGE_S_CBF) {
        return charge->memory.state.soc >= scenario->completion_soc;
    }
    if (charge->periods == charge->edge_period) {
        charge->counted_soc = link_over_the_bus(&scenario->signals.plug_in_soc, charge->plug_in_soc);
    }
    const double share_per_A = scenario->period_s / scenario->baselines.capacity_As;
    charge->counted_soc -= reading_A * share_per_A;
    const bool has_tailed_off = (reading_V >= scenario->baselines.reached_V) &&
                                (-reading_A <= scenario->baselines.tail_current_A);
    return has_tailed_off || (charge->counted_soc >= scenario->completion_soc);
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
    link_answer_t answer = { true, 0.0, BMS_STANDBY, -1.0 };
    if (charge->requested && is_full(charge, heard[0], heard[1])) {
        answer.state = BMS_COMPLETE;
    } else if (charge->requested) {
        const double current_A =
            (charge->controller == CHARGE_S_CBF)
                ? baseline_s_cbf_A(&scenario->baselines, &scenario->nominal, &charge->memory.state,
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

static void note_model_error(void *watcher, const cell_state_t *disturbance)
{
    charge_t *charge = (charge_t *)watcher;
    const charge_differences_t *less = &charge->differences;
    const cell_t *nominal = &charge->scenario->nominal;
    const cell_state_t *state = &charge->memory.state;
    const double core_gap_K = state->core - state->surface;
    const double surface_gap_K = state->surface - state->coolant;
    const double heat_K_per_s =
        (cell_heat_W(&charge->cell, state, charge->current_A) +
         cell_polarisation_heat_W(&charge->cell, charge->memory.polarisation_V)) /
            charge->cell.core_heat_capacity_J_per_K -
        cell_heat_W(nominal, state, charge->current_A) / nominal->core_heat_capacity_J_per_K;
    const double surface_K_per_s = disturbance->surface + less->surface_core_per_s * core_gap_K +
                                   less->surface_gap_per_s * surface_gap_K;
    charge_peaks_t *peaks = &charge->peaks;
    cell_state_t *error = &peaks->model_error;
    error->soc =
        larger(error->soc, fabs(disturbance->soc + less->soc_per_As * charge->current_A));
    error->core = larger(error->core, fabs(disturbance->core + heat_K_per_s +
                                           less->core_gap_per_s * core_gap_K));
    error->surface = larger(error->surface, fabs(surface_K_per_s));
    error->coolant = larger(error->coolant,
                            fabs(disturbance->coolant + less->coolant_gap_per_s * surface_gap_K +
                                 less->coolant_K_per_J * charge->cooling_power_W));
    if (!isnan(charge->surface_error_K_per_s)) {
        peaks->surface_error_slope_K_per_s2 =
            larger(peaks->surface_error_slope_K_per_s2,
                   fabs((surface_K_per_s - charge->surface_error_K_per_s) / charge->cell.step_s));
    }
    charge->surface_error_K_per_s = surface_K_per_s;
}

/* Factor on a knot's core at the present current; 1 where the bound does not depend on it. */
static double core_growth(const charge_t *charge)
{
    const charge_core_bound_t *bound = &charge->scenario->core_bound;
    if (bound->at_reference_K_per_s == bound->constant_K_per_s) {
        return 1.0;
    }
    const double strength_A = fabs(charge->current_A);
    const double at_current_K_per_s = bound->constant_K_per_s + bound->per_A_K_per_As * strength_A +
                                      bound->per_A2_K_per_A2s * strength_A * strength_A;
    return at_current_K_per_s / bound->at_reference_K_per_s;
}

static void advance_plant(charge_t *charge, const double *knots)
{
    charge->heat_J += (cell_heat_W(&charge->cell, &charge->memory.state, charge->current_A) +
                       cell_polarisation_heat_W(&charge->cell, charge->memory.polarisation_V)) *
                      charge->scenario->period_s;
    cell_hold(&charge->cell, &charge->memory, charge->current_A, charge->cooling_power_W,
              core_growth(charge), &charge->knot, knots, CHARGE_SUB_STEPS, &charge->peaks.cell,
              charge->watches_model_error ? note_model_error : NULL, charge);
}

/* Current of the coming period, from an answer: as hil_sim/plant/charger.py. */
static void supply(charge_t *charge, const link_answer_t *answer)
{
    const double command_A =
        answer->intact ? within(answer->command_A, charge->scenario->reference_current_A, 0.0) : 0.0;
    const bool goes_on = (answer->state != BMS_COMPLETE) && (answer->state != BMS_FAULT);
    if (charge->requested && goes_on && (charge->command_A < 0.0) && (command_A == 0.0)) {
        charge->stops++;
    }
    charge->command_A = command_A;
    charge->lagged_A = (charge->supply_share == 1.0)
                           ? command_A
                           : charge->lagged_A + charge->supply_share * (command_A - charge->lagged_A);
    charge->current_A = charge->supply_gain * charge->lagged_A;
}

static void run_period(charge_t *charge, const double *normals, const double *knots)
{
    const charge_scenario_t *scenario = charge->scenario;
    double readings[LINK_READINGS];
    charge->cooling_power_W =
        charge->full_cooling_W *
        within((charge->memory.state.coolant - charge->coolant_floor_K) / scenario->cooling_band_K,
               0.0, 1.0);
    measure(charge, normals, readings);
    const link_answer_t answer = (charge->controller == CHARGE_KAN_RCBF)
                                     ? ask_firmware(charge, readings)
                                     : ask_baseline(charge, readings);
    supply(charge, &answer);
    if (charge->requested) {
        charge->time_s = (double)(charge->periods - charge->edge_period) * scenario->period_s;
        charge->core_sum_K += charge->memory.state.core;
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
                   &knots[i * CHARGE_SUB_STEPS * CELL_KNOT_WIDTH]);
    }
}

void charge_limit_slope(double *knots, uint32_t count, double before, double largest_change)
{
    const uint32_t surface = 2u;
    for (uint32_t i = 0u; i < count; i++) {
        double *knot = &knots[i * CELL_KNOT_WIDTH + surface];
        *knot = before + fmin(fmax(*knot - before, -largest_change), largest_change);
        before = *knot;
    }
}
