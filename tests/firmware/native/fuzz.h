/* A run of the fuzzer: its random numbers, the ECU and its partner, and what was reached. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stdint.h>

#include "random.h"
#include "session.h"

#define FUZZ_STATES 6u

typedef enum {
    MUTATION_DROPPED,
    MUTATION_REPEATED,
    MUTATION_OLD,
    MUTATION_SWAPPED,
    MUTATION_BIT,
    MUTATION_BYTE,
    MUTATION_LENGTH,
    MUTATION_ID,
    MUTATION_CONTENT, /* with the right CRC and counter */
    MUTATION_COUNTER, /* with the right CRC */
    MUTATION_RESTART, /* the sender counts from elsewhere */
    MUTATION_COUNT
} mutation_t;

typedef struct {
    uint64_t frames;
    uint64_t periods;
    uint64_t charges;
    uint64_t with_current;
    uint64_t mutations[MUTATION_COUNT];
    uint64_t foreign;
    uint64_t values;
    uint64_t states[FUZZ_STATES];
    uint64_t symptoms[FAULT_COUNT];
    uint64_t latched_first[FAULT_COUNT];
    uint64_t supervision[CAN_RECEIVED_COUNT][E2E_INVALID + 1];
} statistics_t;

typedef struct {
    random_t random;
    statistics_t statistics;
    bms_t bms;
    session_t session;
    can_frame_t last_sent[CAN_RECEIVED_COUNT];
    bool came_intact[CAN_RECEIVED_COUNT];
    uint32_t frame_share; /* of 1024: frames that are damaged */
    uint32_t foreign_share;
    uint32_t jitter_share; /* periods in which the ECU does not step once */
    bool is_slow;
    uint32_t value_share; /* periods in which a value begins to be wrong */
    session_value_t wrong_value;
    uint32_t wrong_kind;
    uint32_t wrong_periods;
    float wrong_by;
    uint32_t off_periods; /* until the request goes on */
    uint32_t last_state;
    float command_A;
} fuzzer_t;

/* Hands a frame to the ECU. */
void fuzz_deliver(fuzzer_t *fuzzer, const can_frame_t *frame);

/* Hands over what damage on the bus, or in the sender, makes of a frame. */
void fuzz_deliver_damaged(fuzzer_t *fuzzer, uint32_t message, can_frame_t frame);

/* Frames of others, among them such that pass for a message to the ECU, now and then intact. */
void fuzz_deliver_foreign(fuzzer_t *fuzzer);

/* One reading at a time is wrong for a while: biased, drifting, stuck or not available. */
void fuzz_damage_values(fuzzer_t *fuzzer, float values[VALUE_COUNT]);

#endif
