/* Cells in series in one coolant: the true pack. Each cell is that of cell.h; heat flows between the
 * surfaces of neighbours, and the coolant passes one cell after the other, warms, and is cooled before
 * the first. */
#ifndef PLANT_H
#define PLANT_H

#include <stdbool.h>

#include "cell.h"

typedef struct {
    cell_t cell;
    cell_memory_t memory;
    cell_state_t rate;       /* disturbance of its own, constant, in 1/s and K/s */
    cell_state_t coupling;   /* of neighbours and coolant, at the beginning of the last sub-step */
    cell_state_t before;     /* all of it together, at the beginning and the end of a sub-step */
    cell_state_t after;
    cell_peaks_t peaks;
    bool bleeds; /* its resistor is on */
} plant_cell_t;

typedef struct {
    uint32_t cells;
    plant_cell_t *cell;
    double neighbour_W_per_K; /* between two surfaces */
    double flow_W_per_K;      /* heat capacity of the coolant that passes in a second */
    double cooling_power_W;   /* of one cell, in the mean */
    double inlet_K;           /* coolant before the first cell */
    double bleed_ohm;         /* of the resistor across each cell */
    bool has_coupling;        /* that of the last sub-step is known */
    double most_surface_K_per_s; /* magnitude of what neighbours and coolant do to a cell, so far */
    double most_coolant_K_per_s;
    double most_uneven_K; /* coolant beside a cell less that of even warming, so far */
} plant_t;

/* Sub-steps of the cells' step at one current; peaks and magnitudes are kept. */
void plant_hold(plant_t *plant, double current_A, uint32_t steps);

double plant_voltage_V(const plant_t *plant, uint32_t cell, double current_A);

#endif
