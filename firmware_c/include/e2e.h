/* AUTOSAR end-to-end protection, profile 2: CRC-8 with polynomial 0x2F in byte 0, a counter of
 * four bits in the low half of byte 1, and a data id that depends on the counter. */
#ifndef E2E_H
#define E2E_H

#include <stdint.h>

#define E2E_COUNTERS 16
#define E2E_HEADER_LENGTH 2

typedef enum {
    E2E_OK = 0,
    E2E_WRONG_LENGTH = 1,
    E2E_WRONG_CRC = 2,
    E2E_REPEATED = 3,
    E2E_WRONG_SEQUENCE = 4
} e2e_status_t;

/* Receiver state of one message; all zero before the first frame. */
typedef struct {
    uint8_t counter;
    uint8_t started;
} e2e_receiver_t;

/* CRC over bytes 1..length-1 followed by the data id that belongs to the counter. */
uint8_t e2e_crc(const uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS]);

/* Writes counter and CRC into a frame whose remaining bits are set. */
void e2e_protect(uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS],
                 uint8_t counter);

/* Checks a frame; a counter that jumps further than max_jump is refused once and then followed. */
e2e_status_t e2e_check(e2e_receiver_t *receiver, const uint8_t *data, uint8_t length,
                       uint8_t expected_length, const uint8_t data_ids[E2E_COUNTERS],
                       uint8_t max_jump);

#endif
