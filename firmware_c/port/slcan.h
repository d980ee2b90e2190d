/* CAN frames as lines of text, the slcan protocol of serial CAN adapters.
 *
 * From the host: S, s, Z (settings, accepted), O or L (open), C (close), t (frame), F (status
 * flags), V, N (version, serial number). T, r and R are frames that this ECU has no use for. Frames
 * in either direction pass only while the channel is open, and are not acknowledged. A board that
 * restarts has forgotten an open channel, as an adapter does; only the boot stage speaks unasked.
 */
#ifndef SLCAN_H
#define SLCAN_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

#define SLCAN_OK '\r'
#define SLCAN_ERROR '\a'
#define SLCAN_LONGEST_LINE 26u /* T with 8 digits of identifier, length, 8 bytes */
#define SLCAN_LONGEST_FRAME 22u /* t with 3 digits of identifier, length, 8 bytes, end of line */

typedef enum {
    SLCAN_NOTHING,  /* no line is complete, or nothing is to be said to it */
    SLCAN_FRAME,    /* a frame for the ECU */
    SLCAN_ACCEPTED, /* a command; answer SLCAN_OK */
    SLCAN_REFUSED,  /* not a line of this protocol, or a frame while closed; answer SLCAN_ERROR */
    SLCAN_ASKED_FLAGS,
    SLCAN_ASKED_VERSION,
    SLCAN_ASKED_SERIAL_NUMBER
} slcan_event_t;

/* All zero at start-up: closed, no line begun. */
typedef struct {
    uint8_t line[SLCAN_LONGEST_LINE];
    uint32_t length; /* beyond SLCAN_LONGEST_LINE: too long, will be refused */
    bool is_open;
} slcan_t;

/* Takes one byte of the host; fills the frame on SLCAN_FRAME only. */
slcan_event_t slcan_take(slcan_t *slcan, uint8_t byte, can_frame_t *frame);

/* Text of a frame with its end of line; returns its length. */
uint32_t slcan_print(const can_frame_t *frame, uint8_t text[SLCAN_LONGEST_FRAME]);

/* Two digits of a byte. */
void slcan_print_byte(uint8_t byte, uint8_t text[2]);

#endif
