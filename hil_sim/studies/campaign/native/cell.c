#include "cell.h"

static cell_state_t moved(const cell_state_t *state, const cell_state_t *rate, double step_s)
{
    const cell_state_t next = {
        state->soc + step_s * rate->soc,
        state->core + step_s * rate->core,
        state->surface + step_s * rate->surface,
        state->coolant + step_s * rate->coolant,
    };
    return next;
}

static double mean_rate(double a, double b, double c, double d)
{
    return (a + 2.0 * (b + c) + d) / 6.0;
}

cell_state_t cell_rates(const cell_t *cell, const cell_state_t *state, double current_A,
                        double cooling_power_W, const cell_state_t *disturbance)
{
    const double core_to_surface_W =
        (state->core - state->surface) / cell->core_resistance_K_per_W;
    const double surface_to_coolant_W =
        (state->surface - state->coolant) / cell->surface_resistance_K_per_W;
    const double heat_W = (cell->ohmic_resistance_ohm * current_A -
                           cell->entropic_coefficient_V_per_K * state->core) *
                          current_A;
    const cell_state_t rates = {
        disturbance->soc - current_A / cell->capacity_As,
        disturbance->core + (heat_W - core_to_surface_W) / cell->core_heat_capacity_J_per_K,
        disturbance->surface +
            (core_to_surface_W - surface_to_coolant_W) / cell->surface_heat_capacity_J_per_K,
        disturbance->coolant +
            (surface_to_coolant_W - cooling_power_W) / cell->coolant_heat_capacity_J_per_K,
    };
    return rates;
}

cell_state_t cell_step(const cell_t *cell, const cell_state_t *state, double current_A,
                       double cooling_power_W, double step_s, const cell_state_t *first_rates,
                       const cell_state_t *before, const cell_state_t *after)
{
    const cell_state_t middle = {
        0.5 * (before->soc + after->soc),
        0.5 * (before->core + after->core),
        0.5 * (before->surface + after->surface),
        0.5 * (before->coolant + after->coolant),
    };
    const cell_state_t *k1 = first_rates;
    const cell_state_t at2 = moved(state, k1, 0.5 * step_s);
    const cell_state_t k2 = cell_rates(cell, &at2, current_A, cooling_power_W, &middle);
    const cell_state_t at3 = moved(state, &k2, 0.5 * step_s);
    const cell_state_t k3 = cell_rates(cell, &at3, current_A, cooling_power_W, &middle);
    const cell_state_t at4 = moved(state, &k3, step_s);
    const cell_state_t k4 = cell_rates(cell, &at4, current_A, cooling_power_W, after);
    const cell_state_t mean = {
        mean_rate(k1->soc, k2.soc, k3.soc, k4.soc),
        mean_rate(k1->core, k2.core, k3.core, k4.core),
        mean_rate(k1->surface, k2.surface, k3.surface, k4.surface),
        mean_rate(k1->coolant, k2.coolant, k3.coolant, k4.coolant),
    };
    return moved(state, &mean, step_s);
}

double cell_open_circuit_voltage_V(const cell_t *cell, double soc)
{
    const uint32_t last = cell->ocv_points - 1u;
    if (soc <= cell->ocv_soc[0]) {
        return cell->ocv_V[0];
    }
    if (soc >= cell->ocv_soc[last]) {
        return cell->ocv_V[last];
    }
    uint32_t i = 0u;
    while (soc >= cell->ocv_soc[i + 1u]) {
        i++;
    }
    const double slope_V =
        (cell->ocv_V[i + 1u] - cell->ocv_V[i]) / (cell->ocv_soc[i + 1u] - cell->ocv_soc[i]);
    return slope_V * (soc - cell->ocv_soc[i]) + cell->ocv_V[i];
}

double cell_terminal_voltage_V(const cell_t *cell, double soc, double current_A)
{
    return cell_open_circuit_voltage_V(cell, soc) - current_A * cell->ohmic_resistance_ohm;
}
