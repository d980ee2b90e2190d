/* The firmware as seen from the bus: protected frames of measurements in, its answer out. */
#ifndef ECU_LINK_H
#define ECU_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"

/* Scaling of a signal as the CAN database has it, in double precision; limits in raw units. */
typedef struct {
    double scale;
    double offset_steps;
    double lowest;
    double highest;
} link_signal_t;

/* Current, voltage, surface and coolant temperature, cooling power. */
#define LINK_READINGS 5

typedef struct {
    link_signal_t readings[LINK_READINGS];
    link_signal_t reference_current;
    link_signal_t plug_in_soc;
    link_signal_t command_current;
} link_signals_t;

/* What the charger asks for. Without a mode the message that asks for one is left out. */
typedef struct {
    bool charge;
    double reference_current_A;
    double plug_in_soc;
    bool has_mode;
    uint32_t mode; /* codec_mode_t */
    double time_to_full_s; /* negative: none is asked for */
} link_request_t;

typedef struct {
    bool intact; /* a charge command passed its end-to-end check */
    double command_A;
    uint32_t state; /* bms_state_t */
    double predicted_s; /* to full; negative where the plan told none */
} link_answer_t;

typedef struct {
    bms_t bms;
    uint8_t counter;
    e2e_receiver_t command_e2e;
    e2e_receiver_t plan_e2e;
} link_t;

/* Value that arrives when a value is sent: rounded to the signal's step, within its range. */
double link_over_the_bus(const link_signal_t *signal, double value);

/* One control period of the firmware. */
link_answer_t link_exchange(link_t *link, const link_signals_t *signals,
                            const double readings[LINK_READINGS],
                            const link_request_t *asked);

#endif
