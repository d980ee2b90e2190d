/* The true cell in double precision: the equations of bms/cell/model.py, operation by operation,
 * so that a charge here and one of hil_sim/plant/plant.py give the same bits. */
#ifndef CELL_H
#define CELL_H

#include <stdint.h>

#define CELL_MAX_OCV_POINTS 64

typedef struct {
    double capacity_As;
    double core_resistance_K_per_W;
    double core_heat_capacity_J_per_K;
    double surface_resistance_K_per_W;
    double surface_heat_capacity_J_per_K;
    double coolant_heat_capacity_J_per_K;
    double ohmic_resistance_ohm;
    double entropic_coefficient_V_per_K;
    uint32_t ocv_points;
    double ocv_soc[CELL_MAX_OCV_POINTS];
    double ocv_V[CELL_MAX_OCV_POINTS];
} cell_t;

/* State of charge (-) and three temperatures (K); also their rates (1/s, K/s). */
typedef struct {
    double soc;
    double core;
    double surface;
    double coolant;
} cell_state_t;

/* Rates at a current (negative while charging) and a cooling power, plus a disturbance of each. */
cell_state_t cell_rates(const cell_t *cell, const cell_state_t *state, double current_A,
                        double cooling_power_W, const cell_state_t *disturbance);

/* One Runge-Kutta step of fourth order; first_rates are those at its beginning, and the
 * disturbance runs linearly from before to after. */
cell_state_t cell_step(const cell_t *cell, const cell_state_t *state, double current_A,
                       double cooling_power_W, double step_s, const cell_state_t *first_rates,
                       const cell_state_t *before, const cell_state_t *after);

double cell_open_circuit_voltage_V(const cell_t *cell, double soc);

double cell_terminal_voltage_V(const cell_t *cell, double soc, double current_A);

#endif
