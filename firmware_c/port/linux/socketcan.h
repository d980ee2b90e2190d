/* One raw SocketCAN socket: classical data frames with 11-bit identifiers in and out, never waiting
 * but in socketcan_wait, with a count of what was lost on the way.
 */
#ifndef SOCKETCAN_H
#define SOCKETCAN_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

/* Room for the unread frames of some seconds at full bus load. */
#define SOCKETCAN_BUFFER_BYTES (1 << 20)

typedef struct {
    int descriptor;
    int error;         /* errno of a bus that has failed, else 0 */
    uint32_t received; /* frames */
    uint32_t unsent;   /* frames that the bus had no room for */
} socketcan_t;

/* Opens an interface such as vcan0; false with `error` set when it cannot be used. */
bool socketcan_open(socketcan_t *bus, const char *interface);

/* The next frame, at once; false when none waits or the bus has failed. */
bool socketcan_receive(socketcan_t *bus, can_frame_t *frame);

/* Sends a frame, or counts it as unsent. */
void socketcan_send(socketcan_t *bus, const can_frame_t *frame);

/* Frames that the kernel has dropped since the start because they were not read in time. The socket
 * is asked, because SO_RXQ_OVFL tells of a drop only with a later frame, which need not come. */
uint32_t socketcan_unread(const socketcan_t *bus);

/* Returns when a frame waits, after timeout_ms, or at a signal. */
void socketcan_wait(const socketcan_t *bus, int timeout_ms);

#endif
