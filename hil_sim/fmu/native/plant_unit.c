#include "plant_unit.h"

#include <math.h>
#include <string.h>

#include "thermal_step.h"

#define SECONDS_PER_HOUR 3600.0
#define COOLING_BAND_K 1.0
/* Of a sub-step: what rounding of the importer's time may leave. */
#define ROUNDING 1e-6

static bool is_preset(const plant_unit_t *plant, uint32_t first, uint32_t last)
{
    return memcmp(&plant->value[first], &PLANT_START[first],
                  (last - first + 1u) * sizeof(double)) == 0;
}

static void set_branches(cell_t *cell, const double *value, double step_s)
{
    for (uint32_t i = 0u; i < cell->branches; i++) {
        const double time_constant_s = value[PLANT_BRANCH_TIME_CONSTANT_s + 2u * i];
        cell->branch[i].left_at_middle = exp(-0.5 * step_s / time_constant_s);
        cell->branch[i].left_at_end = exp(-step_s / time_constant_s);
    }
}

/* Parameters as they are now; the maps of a sub-step are the preset's own where nothing that they
 * depend on differs, so that the unit computes the very bits of the plant on a bus. */
static void make_cell(plant_unit_t *plant)
{
    const double *value = plant->value;
    cell_t *cell = &plant->cell;
    *cell = PLANT_CELL;
    cell->capacity_As = value[PLANT_CAPACITY_Ah] * SECONDS_PER_HOUR;
    cell->core_resistance_K_per_W = value[PLANT_CORE_RESISTANCE_K_per_W];
    cell->core_heat_capacity_J_per_K = value[PLANT_CORE_HEAT_CAPACITY_J_per_K];
    cell->surface_resistance_K_per_W = value[PLANT_SURFACE_RESISTANCE_K_per_W];
    cell->surface_heat_capacity_J_per_K = value[PLANT_SURFACE_HEAT_CAPACITY_J_per_K];
    cell->coolant_heat_capacity_J_per_K = value[PLANT_COOLANT_HEAT_CAPACITY_J_per_K];
    cell->ohmic_resistance_ohm =
        value[PLANT_OHMIC_RESISTANCE_ohm] * value[PLANT_RESISTANCE_FACTOR];
    cell->entropic_coefficient_V_per_K = value[PLANT_ENTROPIC_COEFFICIENT_V_per_K];
    for (uint32_t i = 0u; i < cell->resistance.rows * cell->resistance.columns; i++) {
        cell->resistance.ohm[i] *= value[PLANT_RESISTANCE_FACTOR];
    }
    for (uint32_t i = 0u; i < cell->branches; i++) {
        cell->branch[i].resistance_ohm = value[PLANT_BRANCH_RESISTANCE_ohm + 2u * i];
    }
    if (!is_preset(plant, PLANT_CORE_RESISTANCE_K_per_W, PLANT_COOLANT_HEAT_CAPACITY_J_per_K)) {
        thermal_step(cell);
    }
    if (!is_preset(plant, PLANT_BRANCH_RESISTANCE_ohm, PLANT_VARIABLES - 1u)) {
        set_branches(cell, value, cell->step_s);
    }
    plant->is_changed = false;
}

static const cell_t *cell_of(plant_unit_t *plant)
{
    if (plant->is_changed) {
        make_cell(plant);
    }
    return &plant->cell;
}

void plant_unit_start(plant_unit_t *plant, double now_s)
{
    memset(plant, 0, sizeof *plant);
    memcpy(plant->value, PLANT_START, sizeof plant->value);
    plant->now_s = now_s;
    plant->is_changed = true;
}

/* Until the run begins, the state is the initial one. */
static void take_start(plant_unit_t *plant)
{
    const double temperature_K = plant->value[PLANT_INITIAL_TEMPERATURE_K];
    plant->memory.state = (cell_state_t){ plant->value[PLANT_INITIAL_SOC], temperature_K,
                                          temperature_K, temperature_K };
}

void plant_unit_run(plant_unit_t *plant)
{
    take_start(plant);
    plant->is_running = true;
}

static double cooling_W(const plant_unit_t *plant)
{
    const double above_K = plant->memory.state.coolant - plant->value[PLANT_COOLANT_FLOOR_K];
    const double share = fmin(fmax(above_K / COOLING_BAND_K, 0.0), 1.0);
    return plant->value[PLANT_FULL_COOLING_POWER_W] * share;
}

bool plant_unit_get(plant_unit_t *plant, uint32_t reference, double *value)
{
    if (reference >= PLANT_VARIABLES) {
        return false;
    }
    if (!plant->is_running) {
        take_start(plant);
    }
    const cell_state_t *state = &plant->memory.state;
    switch (reference) {
    case PLANT_TIME_s:
        *value = plant->now_s;
        break;
    case PLANT_VOLTAGE_V:
        *value = cell_terminal_voltage_V(cell_of(plant), &plant->memory,
                                         plant->value[PLANT_CURRENT_A]);
        break;
    case PLANT_SURFACE_TEMPERATURE_K:
        *value = state->surface;
        break;
    case PLANT_CORE_TEMPERATURE_K:
        *value = state->core;
        break;
    case PLANT_COOLANT_TEMPERATURE_K:
        *value = state->coolant;
        break;
    case PLANT_SOC:
        *value = state->soc;
        break;
    case PLANT_COOLING_POWER_W:
        *value = cooling_W(plant);
        break;
    default:
        *value = plant->value[reference];
        break;
    }
    return true;
}

bool plant_unit_set(plant_unit_t *plant, uint32_t reference, double value)
{
    const bool is_input = (reference == PLANT_CURRENT_A) || (reference == PLANT_FULL_COOLING_POWER_W);
    const bool is_parameter = (reference >= PLANT_FIRST_PARAMETER) && (reference < PLANT_VARIABLES);
    const bool is_signed = (reference == PLANT_ENTROPIC_COEFFICIENT_V_per_K) || is_input;
    const bool may_be_zero = (reference == PLANT_INITIAL_SOC) || (reference == PLANT_COOLANT_FLOOR_K);
    const bool is_initial =
        (reference == PLANT_INITIAL_SOC) || (reference == PLANT_INITIAL_TEMPERATURE_K);
    if (!(is_input || is_parameter) || !isfinite(value) || (is_initial && plant->is_running) ||
        !(is_signed || (value > 0.0) || (may_be_zero && (value == 0.0)))) {
        return false;
    }
    plant->value[reference] = value;
    plant->is_changed = plant->is_changed || is_parameter;
    return true;
}

static void advance_by(plant_unit_t *plant, const cell_t *cell, double cooling_power_W)
{
    const cell_state_t none = { 0.0, 0.0, 0.0, 0.0 };
    cell_step(cell, &plant->memory, plant->value[PLANT_CURRENT_A], cooling_power_W, &none, &none);
}

bool plant_unit_advance(plant_unit_t *plant, double step_s)
{
    if (!isfinite(step_s) || !(step_s > 0.0)) {
        return false;
    }
    const cell_t *cell = cell_of(plant);
    const double cooling_power_W = cooling_W(plant);
    const double sub_steps = floor(step_s / cell->step_s + ROUNDING);
    const double rest_s = step_s - sub_steps * cell->step_s;
    for (double i = 0.0; i < sub_steps; i += 1.0) {
        advance_by(plant, cell, cooling_power_W);
    }
    if (rest_s > ROUNDING * cell->step_s) {
        cell_t shorter = *cell;
        const double whole_K = plant->memory.core_change_K;
        shorter.step_s = rest_s;
        thermal_step(&shorter);
        set_branches(&shorter, plant->value, rest_s);
        /* The step takes the core's middle from its last change, which was in a whole one. */
        plant->memory.core_change_K = whole_K * (rest_s / cell->step_s);
        advance_by(plant, &shorter, cooling_power_W);
        plant->memory.core_change_K *= cell->step_s / rest_s;
    }
    plant->now_s += step_s;
    return true;
}
