/* The cell as a unit of a co-simulation: current and cooling in; voltage, temperatures and state of
 * charge out. The cell is cell.h; here are its parameters, which may change between steps, and steps
 * of any length. */
#ifndef PLANT_UNIT_H
#define PLANT_UNIT_H

#include <stdbool.h>
#include <stdint.h>

#include "cell.h"
#include "plant_variables.h"

/* What the preset says, generated beside this file: the cell with its exact step, and the start
 * value of every variable. */
extern const cell_t PLANT_CELL;
extern const double PLANT_START[PLANT_VARIABLES];

#define PLANT_SET_REFUSED                                                                     \
    "a variable that cannot be set, a value beyond its range, or an initial value after the start"
#define PLANT_STEP_REFUSED "a step needs a length above 0"

typedef struct {
    cell_t cell; /* with the parameters in force and the map of a whole sub-step */
    cell_memory_t memory;
    double value[PLANT_VARIABLES]; /* inputs and parameters; outputs are made when asked for */
    double now_s;
    bool is_running; /* the initial values have been taken */
    bool is_changed; /* a parameter has been set since the cell was made of them */
} plant_unit_t;

/* The preset's cell at its start. */
void plant_unit_start(plant_unit_t *plant, double now_s);

/* Ends the initialisation: from here on the initial values are the past. */
void plant_unit_run(plant_unit_t *plant);

/* Value of a variable; false for a reference that none has. */
bool plant_unit_get(plant_unit_t *plant, uint32_t reference, double *value);

/* False, with nothing changed, for an output, a value beyond its range, and an initial value after
 * the start. */
bool plant_unit_set(plant_unit_t *plant, uint32_t reference, double value);

/* Holds the inputs over a step of any length in s; false, with nothing changed, for none. */
bool plant_unit_advance(plant_unit_t *plant, double step_s);

#endif
