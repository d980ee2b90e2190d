/* What the boot stage says on the bus when it does not start the application: no current, and why.
 *
 * The frames are those of the database, protected as the application's: ChargeCommand with 0 A in
 * state Fault, Diagnostics with the fault Calibration, Identity with firmware version 0, and
 * BootRefusal, which says why.
 */
#ifndef REFUSAL_H
#define REFUSAL_H

#include <stdint.h>

#include "can_frame.h"
#include "image.h"

#define REFUSAL_FRAMES 4
#define REFUSAL_PERIOD_MS 100u

typedef enum {
    REFUSAL_APPLICATION = 1,
    REFUSAL_CALIBRATION = 2,
    REFUSAL_BOOT = 3
} refusal_part_t;

/* The frames of one period; `period` counts from 0. The charge command is the last. */
void refusal_frames(refusal_part_t part, image_status_t status, uint32_t period,
                    can_frame_t frames[REFUSAL_FRAMES]);

#endif
