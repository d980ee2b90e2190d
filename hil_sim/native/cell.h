/* The true cell in double precision: the equations of bms/cell/model.py with an exact step of their
 * linear, thermal part. The heat of a step is that in its middle. */
#ifndef CELL_H
#define CELL_H

#include <stdint.h>

#define CELL_KNOT_WIDTH 4
#define CELL_MAX_POINTS 64
#define CELL_MAX_TABLE 1024
#define CELL_MAX_BRANCHES 3

/* Values over a rising axis, linear between the points; beyond the axis its edge holds. */
typedef struct {
    uint32_t points;
    double axis[CELL_MAX_POINTS];
    double value[CELL_MAX_POINTS];
} cell_curve_t;

/* Resistance over temperature (rows) and state of charge (columns); no rows: a constant. */
typedef struct {
    uint32_t rows;
    uint32_t columns;
    double temperature_K[CELL_MAX_POINTS];
    double soc[CELL_MAX_POINTS];
    double ohm[CELL_MAX_TABLE];
} cell_resistance_t;

/* A branch of polarisation; what is left of a voltage after half a sub-step and a whole one. */
typedef struct {
    double resistance_ohm;
    double left_at_middle;
    double left_at_end;
} cell_branch_t;

/* Change of core, surface and coolant temperature in a sub-step: of each, per kelvin that the core
 * and the coolant are above the surface, per K/s of the disturbance of each at the beginning and
 * at the end, per watt of heat in the core and per watt of cooling. */
typedef struct {
    double core_gap[3];
    double coolant_gap[3];
    double before_s[3][3];
    double after_s[3][3];
    double heat_K_per_W[3];
    double cooling_K_per_W[3];
} cell_thermal_step_t;

typedef struct {
    double step_s;
    double capacity_As;
    double core_resistance_K_per_W;
    double core_heat_capacity_J_per_K;
    double surface_resistance_K_per_W;
    double surface_heat_capacity_J_per_K;
    double coolant_heat_capacity_J_per_K;
    double ohmic_resistance_ohm;
    double entropic_coefficient_V_per_K;
    double overfill_slope_V;
    cell_curve_t ocv_V;
    cell_curve_t entropy_V_per_K; /* no points: the constant */
    cell_resistance_t resistance;
    uint32_t branches;
    cell_branch_t branch[CELL_MAX_BRANCHES];
    cell_thermal_step_t thermal;
} cell_t;

/* State of charge (-) and three temperatures (K), or their rates (1/s, K/s). */
typedef struct {
    double soc;
    double core;
    double surface;
    double coolant;
} cell_state_t;

/* Highest values at any instant so far. */
typedef struct {
    double soc;
    double core_temperature_K;
    double surface_temperature_K;
    double voltage_V;
} cell_peaks_t;

/* What a cell carries from step to step. */
typedef struct {
    cell_state_t state;
    double polarisation_V[CELL_MAX_BRANCHES];
    double core_change_K; /* in the last step; 0 before the first */
} cell_memory_t;

/* Heat in W of resistance and entropy at a current, which is negative while charging. */
double cell_heat_W(const cell_t *cell, const cell_state_t *state, double current_A);

/* Heat in W of the branches at their present voltages. */
double cell_polarisation_heat_W(const cell_t *cell, const double *polarisation_V);

/* One sub-step at constant current and cooling power; the disturbance runs linearly from before to
 * after. */
void cell_step(const cell_t *cell, cell_memory_t *memory, double current_A, double cooling_power_W,
               const cell_state_t *before, const cell_state_t *after);

/* Looks at a cell at the beginning of a sub-step, with the disturbance there. */
typedef void (*cell_watch_t)(void *watcher, const cell_state_t *disturbance);

/* Holds a current and a cooling power over sub-steps, and the peaks with it. A knot is the
 * disturbance of soc, core, surface and coolant at an instant: the one before is kept, the others
 * are those at the end of each sub-step. `growth` is a factor on the core's. `watch` may be NULL. */
void cell_hold(const cell_t *cell, cell_memory_t *memory, double current_A, double cooling_power_W,
               double growth, cell_state_t *knot, const double *knots, uint32_t steps,
               cell_peaks_t *peaks, cell_watch_t watch, void *watcher);

double cell_open_circuit_voltage_V(const cell_t *cell, double soc);

double cell_terminal_voltage_V(const cell_t *cell, const cell_memory_t *memory, double current_A);

#endif
