/* The exact step of the cell's linear, thermal part, for parameters or steps that the preset does
 * not have; bms makes that of the preset by the same equations (hil_sim/native/cell_fields.py). */
#ifndef THERMAL_STEP_H
#define THERMAL_STEP_H

#include "cell.h"

/* Fills the map of a step of cell->step_s for heat and cooling; that of a disturbance stays 0. */
void thermal_step(cell_t *cell);

#endif
