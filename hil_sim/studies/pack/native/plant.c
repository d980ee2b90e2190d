#include "plant.h"

#include <math.h>

static double larger(double a, double b)
{
    return (a > b) ? a : b;
}

/* Rates at which neighbours and coolant change a cell's temperatures, beside what the cell alone does
 * at the mean cooling power. */
static cell_state_t coupling_of(plant_t *plant, uint32_t i)
{
    const plant_cell_t *all = plant->cell;
    const cell_state_t *own = &all[i].memory.state;
    double neighbours_W = 0.0;
    if (i > 0u) {
        neighbours_W += plant->neighbour_W_per_K * (all[i - 1u].memory.state.surface - own->surface);
    }
    if (i + 1u < plant->cells) {
        neighbours_W += plant->neighbour_W_per_K * (all[i + 1u].memory.state.surface - own->surface);
    }
    const double before_K = (i == 0u) ? plant->inlet_K : all[i - 1u].memory.state.coolant;
    const double flow_W = plant->flow_W_per_K * (before_K - own->coolant) + plant->cooling_power_W;
    return (cell_state_t){
        .surface = neighbours_W / all[i].cell.surface_heat_capacity_J_per_K,
        .coolant = (plant->cells > 1u) ? (flow_W / all[i].cell.coolant_heat_capacity_J_per_K) : 0.0,
    };
}

/* Current of a cell, of which the resistor takes its part. */
static double own_current_A(const plant_t *plant, const plant_cell_t *one, double current_A)
{
    return one->bleeds ? current_A + cell_terminal_voltage_V(&one->cell, &one->memory, current_A) /
                                         plant->bleed_ohm
                       : current_A;
}

static void note_voltage(const plant_t *plant, plant_cell_t *one, double current_A)
{
    const double own_A = own_current_A(plant, one, current_A);
    one->peaks.voltage_V = larger(one->peaks.voltage_V,
                                  cell_terminal_voltage_V(&one->cell, &one->memory, own_A));
}

static void note_peaks(plant_t *plant, plant_cell_t *one, uint32_t i, double current_A)
{
    const cell_state_t *state = &one->memory.state;
    const double outlet_K = plant->cell[plant->cells - 1u].memory.state.coolant;
    const double even_K = plant->inlet_K + (double)(i + 1u) / (double)plant->cells *
                                               (outlet_K - plant->inlet_K);
    one->peaks.soc = larger(one->peaks.soc, state->soc);
    one->peaks.core_temperature_K = larger(one->peaks.core_temperature_K, state->core);
    one->peaks.surface_temperature_K = larger(one->peaks.surface_temperature_K, state->surface);
    note_voltage(plant, one, current_A);
    plant->most_surface_K_per_s = larger(plant->most_surface_K_per_s, fabs(one->coupling.surface));
    plant->most_coolant_K_per_s = larger(plant->most_coolant_K_per_s, fabs(one->coupling.coolant));
    plant->most_uneven_K = larger(plant->most_uneven_K, fabs(state->coolant - even_K));
}

static cell_state_t sum_of(const cell_state_t *a, const cell_state_t *b)
{
    return (cell_state_t){ a->soc + b->soc, a->core + b->core, a->surface + b->surface,
                           a->coolant + b->coolant };
}

/* Where it goes on as it did in the last sub-step. */
static cell_state_t next_of(const cell_state_t *last, const cell_state_t *now)
{
    return (cell_state_t){ .surface = 2.0 * now->surface - last->surface,
                           .coolant = 2.0 * now->coolant - last->coolant };
}

/* All couplings are taken from the same instant, before any cell moves on. */
static void step(plant_t *plant, double current_A)
{
    const double outlet_K = plant->cell[plant->cells - 1u].memory.state.coolant;
    plant->inlet_K =
        outlet_K - (double)plant->cells * plant->cooling_power_W / plant->flow_W_per_K;
    for (uint32_t i = 0u; i < plant->cells; i++) {
        plant_cell_t *one = &plant->cell[i];
        const cell_state_t now = coupling_of(plant, i);
        const cell_state_t next = plant->has_coupling ? next_of(&one->coupling, &now) : now;
        one->coupling = now;
        one->before = sum_of(&one->rate, &now);
        one->after = sum_of(&one->rate, &next);
    }
    plant->has_coupling = true;
    for (uint32_t i = 0u; i < plant->cells; i++) {
        plant_cell_t *one = &plant->cell[i];
        cell_step(&one->cell, &one->memory, own_current_A(plant, one, current_A),
                  plant->cooling_power_W, &one->before, &one->after);
        note_peaks(plant, one, i, current_A);
    }
}

void plant_hold(plant_t *plant, double current_A, uint32_t steps)
{
    for (uint32_t i = 0u; i < plant->cells; i++) {
        note_voltage(plant, &plant->cell[i], current_A);
    }
    for (uint32_t i = 0u; i < steps; i++) {
        step(plant, current_A);
    }
}

double plant_voltage_V(const plant_t *plant, uint32_t cell, double current_A)
{
    const plant_cell_t *one = &plant->cell[cell];
    return cell_terminal_voltage_V(&one->cell, &one->memory,
                                   own_current_A(plant, one, current_A));
}
