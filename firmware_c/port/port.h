/* What a port provides to the main loop: four functions. A port has its own state. */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"

/* The next frame of the bus, at once; false when none waits. */
bool port_receive(can_frame_t *frame);

/* Hands a frame to the bus without waiting; one that finds no room is lost, and counted. */
void port_send(const can_frame_t *frame);

/* Milliseconds from any origin; wraps around. */
uint32_t port_time_ms(void);

/* Returns when a frame may wait or at until_ms at the latest, which may be over; earlier does no
 * harm. */
void port_idle(uint32_t until_ms);

#endif
