/* What the boot stage says on the bus when it does not start the application: no current, and why.
 *
 * The frames are those of the database, protected as the application's: ChargeCommand with 0 A in
 * state Fault, Diagnostics with the fault Calibration, and Identity with firmware version 0, whose
 * model hash says why: the refused part (1 application, 2 calibration, 3 boot stage) times 256
 * plus the number of the failed check (image_status_t).
 */
#ifndef REFUSAL_H
#define REFUSAL_H

#include <stdint.h>

#include "can_frame.h"
#include "image.h"

#define REFUSAL_FRAMES 3
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
