/* A serial line that carries frames: slcan text between two ring buffers, and what was lost.
 *
 * The interrupt handlers use slcan_link_put and slcan_link_get, the main program the others. A line
 * that finds no room is lost as a whole. Losses are reported in two ways: as the flags that the host
 * asks for with F, and as a frame SLCAN_LINK_LOSS_ID of two little-endian 32-bit numbers, lines lost
 * on receipt and frames lost in sending since start-up, as soon as there is room for it.
 */
#ifndef SLCAN_LINK_H
#define SLCAN_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "ring.h"
#include "slcan.h"

#define SLCAN_LINK_LOSS_ID 0x7F0u

/* Flags of the answer to F, as adapters have them. */
#define SLCAN_LINK_RECEIVE_FULL 0x01u
#define SLCAN_LINK_SEND_FULL 0x02u

/* All zero at start-up. */
typedef struct {
    ring_t from_host;
    ring_t to_host;
    slcan_t slcan;
    bool is_cut_off;  /* the last line in the buffer lacks its end */
    bool is_dropping; /* the rest of the present line goes with it */
    volatile uint32_t lines_lost;
    uint32_t frames_lost;
    uint32_t lines_lost_reported;
    uint32_t frames_lost_reported;
    uint32_t lines_lost_flagged;
    uint32_t frames_lost_flagged;
} slcan_link_t;

/* A byte has come from the host. */
void slcan_link_put(slcan_link_t *link, uint8_t byte);

/* The next byte for the host; false when there is none. */
bool slcan_link_get(slcan_link_t *link, uint8_t *byte);

/* Whether no byte of the host waits. */
bool slcan_link_is_quiet(const slcan_link_t *link);

/* The next frame of the host; commands are answered on the way. */
bool slcan_link_receive(slcan_link_t *link, can_frame_t *frame);

/* Queues a frame for the host; without an open channel it is on no bus and goes nowhere. */
void slcan_link_send(slcan_link_t *link, const can_frame_t *frame);

#endif
