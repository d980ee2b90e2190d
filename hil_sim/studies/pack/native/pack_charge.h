/* One charge of a pack in closed loop: plant, sensors, charger and the pack's control core. Random
 * numbers come from the caller. */
#ifndef PACK_CHARGE_H
#define PACK_CHARGE_H

#include "pack.h"
#include "plant.h"

#define PACK_SUB_STEPS 10

/* Standard normal numbers of a period, beside two for each cell: current, inlet, outlet, power. */
#define PACK_SHARED_NORMALS 4

typedef enum {
    PACK_RUNNING = 0,
    PACK_COMPLETE = 1,
    PACK_FAULT = 2,
    PACK_TIME_LIMIT = 3
} pack_outcome_t;

/* reading = round(truth + noise) to the resolution; 0 means no rounding */
typedef struct {
    double resolution;
    double noise_std;
} pack_sensor_t;

typedef struct {
    plant_t plant;
    double period_s;
    double max_time_s;
    double reference_current_A;
    double full_cooling_W;  /* of one cell */
    double coolant_floor_K; /* over the band above it the cooling fades out */
    double cooling_band_K;
    double noise_cutoff; /* of the standard normal numbers */
    uint32_t off_periods; /* before the charge is requested */
    pack_sensor_t current;
    pack_sensor_t voltage;
    pack_sensor_t surface;
    pack_sensor_t coolant;
    pack_sensor_t power;
    uint32_t seen;            /* cells that the controller sees */
    const uint8_t *seen_cell; /* which */
    const uint8_t *thermistor_cell; /* the cell that each thermistor is at */
    bool sees_mean; /* of the cells that it sees, as if that were one */
    const float *plug_in_soc; /* of each cell that the controller knows of */
    pack_t pack;
    double current_A;
    pack_outcome_t outcome;
    uint32_t periods;
    uint32_t edge_period;
    bool requested;
    double time_s; /* since the request */
    uint32_t stops; /* from a current to a command of 0 A, while the charge goes on */
    uint32_t governed[BMS_MAX_CELLS]; /* periods in which each cell limited the current */
} pack_charge_t;

/* What the sensors read in a period, of each cell that the controller sees. */
typedef struct {
    float current_A;
    float coolant_in_K;
    float coolant_out_K;
    float cooling_power_W;
    float voltage_V[BMS_MAX_CELLS];
    float surface_temperature_K[BMS_MAX_CELLS]; /* of each thermistor */
} pack_measured_t;

/* Prepares a charge whose members down to plug_in_soc are set and whose others are zero. */
void pack_charge_begin(pack_charge_t *charge, const pack_config_t *config);

/* Runs up to `periods` control periods, with two standard normal numbers for each cell and
 * PACK_SHARED_NORMALS for each of them. */
void pack_charge_advance(pack_charge_t *charge, const double *normals, uint32_t periods);

/* Sets the cooling of a period and reads the sensors, with the standard normal numbers of one. */
void pack_charge_measure(pack_charge_t *charge, const double *normals, pack_measured_t *measured);

double pack_sensor_reading(const pack_sensor_t *sensor, double truth, double normal,
                           double noise_cutoff);

/* Steps a pack over and over with these readings, one set after the other, for its time. */
void pack_repeat(pack_t *pack, const pack_readings_t *readings, uint32_t sets, uint32_t periods);

#endif
