/* A pack that the page charges, as it is handed to the module. */
#ifndef PACK_SCENARIO_H
#define PACK_SCENARIO_H

#include <stdint.h>

#include "normals.h"
#include "pack_charge.h"

#define PACK_PAGE_MOST_CELLS 16
#define PACK_PAGE_SENSOR_STREAM 1 /* child of the seed, as for one cell */

/* A charge that begins, without pointers: cells at rest, each with a thermistor. */
typedef struct {
    bms_calibration_t calibration;
    pack_bare_t bare;
    normals_tables_t normals;
    uint32_t cells;
    uint32_t seed;
    plant_cell_t cell[PACK_PAGE_MOST_CELLS];
    float plug_in_soc[PACK_PAGE_MOST_CELLS];
    double neighbour_W_per_K;
    double flow_W_per_K;
    double period_s;
    double max_time_s;
    double reference_current_A;
    double full_cooling_W;
    double coolant_floor_K;
    double cooling_band_K;
    double noise_cutoff;
    uint32_t off_periods;
    pack_sensor_t current;
    pack_sensor_t voltage;
    pack_sensor_t surface;
    pack_sensor_t coolant;
    pack_sensor_t power;
} pack_scenario_t;

#endif
