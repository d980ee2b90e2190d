/* AUTOSAR end-to-end protection, profile 2: CRC-8 with polynomial 0x2F in byte 0, a counter of
 * four bits in the low half of byte 1, and a data id that depends on the counter.
 *
 * Each frame is checked when it comes (e2e_check); once a period the state machine of AUTOSAR's
 * E2E library (e2e_supervise) judges the last few periods together.
 */
#ifndef E2E_H
#define E2E_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define E2E_COUNTERS 16
#define E2E_HEADER_LENGTH 2
#define E2E_LONGEST_WINDOW 8

typedef enum {
    E2E_OK = 0,
    E2E_WRONG_LENGTH = 1,
    E2E_WRONG_CRC = 2,
    E2E_REPEATED = 3,
    E2E_WRONG_SEQUENCE = 4, /* more frames are lost than may be */
    E2E_REORDERED = 5       /* older than the last good one */
} e2e_status_t;

typedef enum { E2E_NO_DATA = 0, E2E_INIT = 1, E2E_VALID = 2, E2E_INVALID = 3 } e2e_state_t;

/* A period is good with an intact frame in sequence, bad with one of wrong length or CRC; with
 * neither nothing came, or nothing new. */
typedef struct {
    uint8_t min_good;
    uint8_t max_bad;
} e2e_limits_t;

typedef struct {
    uint8_t max_delta_counter; /* a step of the counter up to which frames may be lost */
    uint8_t window_periods;    /* periods that are judged together */
    e2e_limits_t init;         /* what leads from init to valid; with more bad ones, to invalid */
    e2e_limits_t valid;        /* what valid needs to stay */
    e2e_limits_t invalid;      /* what leads from invalid back to valid */
} e2e_policy_t;

/* Frames since start-up; each number stays at its maximum. */
typedef struct {
    uint8_t wrong_length;
    uint8_t wrong_crc;
    uint8_t repeated;
    uint8_t lost; /* by the counter's steps, so that 16 lost in a row are not seen */
    uint8_t reordered;
} e2e_counts_t;

/* Receiver state of one message; all zero before the first frame. */
typedef struct {
    uint8_t counter;         /* of the last good frame */
    uint8_t refused_counter; /* of the last frame out of sequence */
    bool has_started;
    bool has_refused;
    bool is_good; /* this and the next two: what came since the last e2e_supervise */
    bool is_bad;
    bool is_disturbed; /* any frame was refused */
    uint8_t good_periods; /* bit n: n periods ago */
    uint8_t bad_periods;
    e2e_state_t state;
    e2e_counts_t counts;
} e2e_receiver_t;

typedef struct {
    bool is_usable;    /* the period brought a good frame, and the message is valid */
    bool is_disturbed; /* a frame of the period was refused */
} e2e_verdict_t;

/* CRC over bytes 1..length-1 followed by the data id that belongs to the counter; a length is
 * E2E_HEADER_LENGTH or more. */
uint8_t e2e_crc(const uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS]);

/* Writes counter and CRC into a frame whose remaining bits are set. */
void e2e_protect(uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS],
                 uint8_t counter);

/* Checks and counts a frame. One whose counter is out of sequence is refused; when the next one
 * continues from there, the sender has started anew and is followed. */
e2e_status_t e2e_check(e2e_receiver_t *receiver, const uint8_t *data, uint8_t length,
                       uint8_t expected_length, const uint8_t data_ids[E2E_COUNTERS],
                       uint8_t max_delta_counter);

/* Ends a period: moves the state and forgets what came. */
e2e_verdict_t e2e_supervise(e2e_receiver_t *receiver, const e2e_policy_t *policy);

#ifdef __cplusplus
}
#endif

#endif
