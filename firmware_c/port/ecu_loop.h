/* The main loop of every port: frames to the application, steps on SYNC or on the own clock.
 *
 * A SYNC frame starts a control period, and the own clock waits for the next one. Without SYNC the
 * application steps on the port's clock; the first frame sets the phase, so that steps fall midway
 * between measurements. A SYNC that stays away for ECU_LOOP_SYNC_SILENCE_MS brings the own clock
 * back, so that the application sees the silence and commands 0 A.
 */
#ifndef ECU_LOOP_H
#define ECU_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"

#define ECU_LOOP_SYNC_ID 0x080u /* CiA 301 */
#define ECU_LOOP_SYNC_SILENCE_MS 5000u

typedef struct {
    bms_t bms;
    uint32_t period_ms;
    uint32_t due_ms; /* next step by the own clock; in lock step, when SYNC has stayed away too long */
    bool is_started; /* a frame has come */
} ecu_loop_t;

/* The calibration must outlive the loop; without a usable one the application stays in fault. */
void ecu_loop_init(ecu_loop_t *loop, const bms_calibration_t *calibration);

/* Takes one frame or waits for one, and steps when it is time to; to be called for ever. */
void ecu_loop_turn(ecu_loop_t *loop);

#endif
