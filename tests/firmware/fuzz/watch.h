/* Holds what an ECU sends to what it was sent: an oracle that knows frames, not the ECU's state. */
#ifndef WATCH_H
#define WATCH_H

#include "bms.h"
#include "can_catalog.h"

/* Of the intact frames of a message since the last step. */
typedef struct {
    uint32_t intact;
    uint32_t usable; /* of these, those whose readings are numbers and allow a charge */
} watch_message_t;

typedef struct {
    float reference_current_A; /* of the calibration: no current is stronger */
    float growth_A;
    float highest_surface_K; /* beyond these, readings forbid current */
    float highest_voltage_V;
} watch_limits_t;

typedef struct {
    watch_limits_t limits;
    watch_message_t messages[CAN_RECEIVED_COUNT];
    float strongest_asked_A; /* since the last step */
    bool was_off;            /* an intact request was off since the start or the last charge */
    bool was_charging;
    float command_A;
    uint32_t latched; /* until a request is off */
    bool has_counter;
    uint8_t counter; /* of the last command */
} watch_t;

/* At a start of the ECU. */
void watch_begin(watch_t *watch, const bms_calibration_t *calibration);

/* Before a frame is handed to the ECU. */
void watch_frame(watch_t *watch, const can_frame_t *frame);

/* One frame that the ECU sends. */
void watch_sent(watch_t *watch, const can_frame_t *frame);

/* After all of them: whether there was a command. */
void watch_end_period(watch_t *watch, const can_frame_t *last);

/* Steps, and holds all that is sent to the rules; the command. */
float watch_step(watch_t *watch, bms_t *bms);

#endif
