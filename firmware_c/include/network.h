/* The received messages: which frame belongs to which, whether it may be used, how it fared. */
#ifndef NETWORK_H
#define NETWORK_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "codec.h"
#include "e2e.h"

#ifdef __cplusplus
extern "C" {
#endif

#define NETWORK_MESSAGES 5

/* Index: order of CAN_RECEIVED. All zero before the first frame. */
typedef struct {
    e2e_receiver_t receivers[NETWORK_MESSAGES];
    bool is_usable[NETWORK_MESSAGES]; /* in the period that network_step has ended */
    bool is_disturbed;                /* any frame of that period was refused */
    uint8_t measured_periods; /* since network_step, by the counter of CellElectrical */
} network_t;

/* Checks a frame and takes its content over when it is good; foreign ones are ignored. */
void network_receive(network_t *network, const can_frame_t *frame,
                     codec_measurement_t *measurement);

/* Ends a period: judges every message. */
void network_step(network_t *network);

/* Whether every message that has to come has done so often enough to be trusted. */
bool network_is_valid(const network_t *network);

#ifdef __cplusplus
}
#endif

#endif
