/* The parts of a charge over a bus in C: the cell with its sensors and charger on one side, the
 * firmware on the other. As hil_sim/run/charge.py; the order of a period, and what a fault changes
 * between two parts, is the caller's. */
#ifndef SESSION_H
#define SESSION_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"
#include "charge.h"
#include "normals.h"
#include "wire.h"

#define SESSION_MESSAGES 5
#define SESSION_MOST_FRAMES 1024
#define SESSION_MOST_INTACT 32
#define SESSION_MOST_WINDOW 16
#define SESSION_SENSOR_STREAM 1 /* child of the seed that hil_sim/run/parts.py gives the sensors */

/* What does not depend on the settings of a run. */
typedef struct {
    charge_scenario_t charge;
    wire_t published; /* electrical, thermal, coolant, request, mode */
    wire_message_t command;
    bms_calibration_t calibration;
    normals_tables_t normals;
    double bias[LINK_READINGS]; /* of the sensors */
    uint32_t calibration_content;
    uint32_t command_current; /* place of the signal in the command */
    uint32_t silent_periods_to_stop;
} session_scenario_t;

typedef struct {
    uint32_t seed;
    double soc;
    double temperature_K;
    double cooling_power_W;
    double resistance_factor; /* of the true cell over the preset's */
    double capacity_factor;
} session_settings_t;

/* Intact commands of a period, each once. */
typedef struct {
    uint32_t count;
    uint8_t data[SESSION_MOST_INTACT][8];
} session_intact_t;

/* The charger's end of the bus, as bms/firmware/reception.py and hil_sim/nodes/commands.py. */
typedef struct {
    e2e_receiver_t e2e;
    session_intact_t intact[SESSION_MOST_WINDOW]; /* [0] is the present period */
    uint32_t contested_periods;
    bool has_told;
    uint8_t told[8]; /* the last command in sequence of the period that has ended */
} session_reception_t;

typedef struct {
    const session_scenario_t *scenario;
    session_settings_t settings;
    cell_t cell;
    cell_memory_t memory;
    cell_state_t knot;
    cell_peaks_t peaks;
    normals_t normals;
    wire_t published;
    bms_t bms;
    session_reception_t reception;
    double full_cooling_W;
    double current_A;
    double held_A; /* the charger's */
    uint32_t silent_periods;
} session_t;

void session_begin(session_t *session, const session_scenario_t *scenario,
                   const session_settings_t *settings);

/* The ECU comes up with fresh state. */
void session_start_ecu(session_t *session);

/* Cooling power in W of this period. */
double session_cooling_power_W(const session_t *session);

double session_voltage_V(const session_t *session);

/* What the sensors say: current, voltage, surface and coolant temperature, cooling power. */
void session_measure(session_t *session, double readings[LINK_READINGS]);

/* Fills the frames of a period with the values of all signals in their order; the message that asks
 * for a mode is the last. Returns how many there are. */
uint32_t session_publish(session_t *session, const double *values, bool has_mode,
                         can_frame_t *frames);

/* The ECU takes frames, steps and answers; returns how many answers there are. */
uint32_t session_exchange(session_t *session, const can_frame_t *frames, uint32_t count,
                          can_frame_t *answers);

/* What the charger may supply after these frames of the ECU, in A; NaN without a usable command. */
double session_hear(session_t *session, const can_frame_t *frames, uint32_t count);

/* Current in A of the coming period by the charger's rule. */
double session_obey(session_t *session, double usable_A);

/* Holds the current for one period. */
void session_advance(session_t *session);

#endif
