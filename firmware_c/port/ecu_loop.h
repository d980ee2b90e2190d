/* The main loop of every port: frames to the application, steps on SYNC or on the own clock.
 *
 * A SYNC frame starts a control period, and the own clock waits for the next one: lock step. A SYNC
 * that stays away for ECU_LOOP_SYNC_SILENCE_MS brings the own clock back, so that the application
 * sees the silence and commands 0 A. A charge that runs by the own clock keeps it: every SYNC is
 * foreign to it and ignored. Before a charge any SYNC begins lock step, whoever sends it.
 *
 * On the own clock steps fall midway between measurements. The first frame sets the phase; then the
 * first measurement, and after every ECU_LOOP_PHASE_PERIODS with one the most punctual of these,
 * correct it, so that clocks that run apart leave no periods without measurements.
 */
#ifndef ECU_LOOP_H
#define ECU_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"

#define ECU_LOOP_SYNC_SILENCE_MS 5000u
#define ECU_LOOP_PHASE_PERIODS 20u

typedef struct {
    bms_t bms;
    uint32_t period_ms;
    uint32_t due_ms; /* next step by the own clock; in lock step, when SYNC has stayed away too long */
    bool is_started; /* a frame has come */
    bool is_in_lock_step;
    bool is_measured;          /* a measurement has come since the last step */
    uint32_t measured_periods; /* since the phase was corrected */
    int32_t earliest_ms;       /* how much later than half a period before a step one came, at least */
} ecu_loop_t;

/* The calibration must outlive the loop; without a usable one the application stays in fault. */
void ecu_loop_init(ecu_loop_t *loop, const bms_calibration_t *calibration);

/* Takes one frame or waits for one, and steps when it is time to; to be called for ever. */
void ecu_loop_turn(ecu_loop_t *loop);

#endif
