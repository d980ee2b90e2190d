/* The plant's side of the bus: physical values to protected frames and back, in double precision.
 *
 * The layout of a message comes from the CAN database at run time (hil_sim/bus/wire.py); CRC and
 * counter are the firmware's own (e2e.h). A value beyond a signal's range is sent as the end of the
 * range; NaN is sent, and read, as "not available" (all ones).
 */
#ifndef WIRE_H
#define WIRE_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "e2e.h"

#define WIRE_MAX_SIGNALS 8
#define WIRE_MAX_MESSAGES 16

/* An unsigned little-endian field; its value is (raw + offset_steps) * scale. */
typedef struct {
    uint8_t start;
    uint8_t length;
    double scale;
    double offset_steps;
    double lowest; /* raw values that carry a number */
    double highest;
} wire_signal_t;

typedef struct {
    uint32_t id;
    uint8_t length;
    uint8_t is_protected;
    uint8_t data_ids[E2E_COUNTERS];
    uint32_t signals;
    wire_signal_t signal[WIRE_MAX_SIGNALS];
} wire_message_t;

/* Messages of one direction with what is known of their counters, and one value for each signal, in
 * the order of messages and signals. */
typedef struct {
    uint32_t messages;
    wire_message_t message[WIRE_MAX_MESSAGES];
    uint8_t counter[WIRE_MAX_MESSAGES]; /* the next one to send, or the last one received */
    bool has_counter[WIRE_MAX_MESSAGES];
} wire_t;

/* Fills a frame for each of the first `messages` and moves their counters on. */
void wire_send(wire_t *wire, uint32_t messages, const double *values, can_frame_t *frames);

/* Takes frames in order; sets the values of each that is intact and, where it has a counter, does
 * not repeat the last one. Frames of other messages are passed over. */
void wire_receive(wire_t *wire, const can_frame_t *frames, uint32_t count, double *values);

/* Whether length and CRC of a payload are those of a message. */
bool wire_is_intact(const wire_message_t *message, const uint8_t *data, uint32_t length);

/* Values of an intact payload. */
void wire_decode(const wire_message_t *message, const uint8_t *data, double *values);

#endif
