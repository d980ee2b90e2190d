/* A healthy partner for the ECU: cell, sensors, charger and charge request, as protected frames. */
#ifndef SESSION_H
#define SESSION_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"
#include "can_catalog.h"

typedef enum {
    VALUE_CURRENT,
    VALUE_VOLTAGE,
    VALUE_SURFACE,
    VALUE_COOLANT,
    VALUE_COOLING,
    VALUE_REFERENCE,
    VALUE_PLUG_IN_SOC,
    VALUE_REQUEST,
    VALUE_MODE,
    VALUE_TIME_TO_FULL,
    VALUE_COUNT
} session_value_t;

typedef struct {
    float soc;
    float core_K;
    float surface_K;
    float coolant_K;
    float current_A; /* negative while charging */
    float cooling_W;
} session_cell_t;

typedef struct {
    session_cell_t cell;
    bool is_on; /* the charge is requested */
    bool sends_mode; /* the optional message comes too */
    codec_mode_t mode;
    float reference_A;
    float plug_in_soc;
    uint8_t counters[CAN_RECEIVED_COUNT];
} session_t;

void session_begin(session_t *session, float soc, float temperature_K);

/* What a perfect sensor reads, and what the charger asks for. */
void session_measure(const session_t *session, float values[VALUE_COUNT]);

/* Whether a message is sent at present. */
bool session_sends(const session_t *session, uint32_t message);

/* The frame of a message with these values and the message's next counter. */
can_frame_t session_frame(session_t *session, uint32_t message, const float values[VALUE_COUNT]);

/* Writes another counter, or other content, with the CRC that belongs to it. */
void session_protect(can_frame_t *frame, uint32_t message, uint8_t counter);

/* One control period of the cell at the commanded current. */
void session_advance(session_t *session, float command_A);

#endif
