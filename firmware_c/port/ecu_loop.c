#include "ecu_loop.h"

#include <stddef.h>

#include "can_db.h"
#include "port.h"

#define MS_PER_S 1000.0f
#define DEFAULT_PERIOD_MS 100u
#define MEASUREMENT_ID CAN_DB_CELL_ELECTRICAL_FRAME_ID /* with which a period begins */

static bool is_reached(uint32_t now_ms, uint32_t due_ms)
{
    return (int32_t)(now_ms - due_ms) >= 0;
}

static void step(ecu_loop_t *loop)
{
    can_frame_t frame;
    bms_step(&loop->bms);
    while (bms_transmit(&loop->bms, &frame)) {
        port_send(&frame);
    }
}

static bool is_charging(const bms_t *bms)
{
    return (bms->state == BMS_CHARGING) || (bms->state == BMS_DERATED);
}

/* The next measurement corrects the phase by itself. */
static void forget_phase(ecu_loop_t *loop)
{
    loop->is_measured = false;
    loop->measured_periods = ECU_LOOP_PHASE_PERIODS - 1u;
    loop->earliest_ms = INT32_MAX;
}

static void take_sync(ecu_loop_t *loop)
{
    step(loop);
    loop->due_ms = port_time_ms() + ECU_LOOP_SYNC_SILENCE_MS;
    loop->is_in_lock_step = true;
    forget_phase(loop);
}

/* One a period, so that many of them move the phase no more often; none after a stall. */
static void take_measurement(ecu_loop_t *loop)
{
    const uint32_t now_ms = port_time_ms();
    const int32_t late_ms = (int32_t)(now_ms + loop->period_ms / 2u - loop->due_ms);
    if (loop->is_measured || is_reached(now_ms, loop->due_ms)) {
        return;
    }
    loop->is_measured = true;
    loop->measured_periods++;
    if (late_ms < loop->earliest_ms) {
        loop->earliest_ms = late_ms;
    }
}

static void take(ecu_loop_t *loop, const can_frame_t *frame)
{
    bms_receive(&loop->bms, frame);
    if (!loop->is_started) {
        loop->due_ms = port_time_ms() + loop->period_ms / 2u;
        loop->is_started = true;
    }
    if ((frame->id == CAN_DB_SYNC_FRAME_ID) &&
        (loop->is_in_lock_step || !is_charging(&loop->bms))) {
        take_sync(loop);
    } else if ((frame->id == MEASUREMENT_ID) && !loop->is_in_lock_step) {
        take_measurement(loop);
    }
}

static void correct_phase(ecu_loop_t *loop)
{
    loop->is_measured = false;
    if (loop->measured_periods >= ECU_LOOP_PHASE_PERIODS) {
        loop->due_ms += (uint32_t)loop->earliest_ms;
        loop->measured_periods = 0u;
        loop->earliest_ms = INT32_MAX;
    }
}

/* After a stall, missed periods are not caught up, and the phase stays. */
static void follow_clock(ecu_loop_t *loop)
{
    const uint32_t now_ms = port_time_ms();
    if (!loop->is_started || !is_reached(now_ms, loop->due_ms)) {
        return;
    }
    loop->is_in_lock_step = false;
    loop->due_ms += loop->period_ms * ((now_ms - loop->due_ms) / loop->period_ms + 1u);
    step(loop);
    correct_phase(loop);
}

void ecu_loop_init(ecu_loop_t *loop, const bms_calibration_t *calibration)
{
    const bms_config_t config = { calibration };
    bms_init(&loop->bms, &config);
    loop->period_ms = (loop->bms.calibration != NULL)
                          ? (uint32_t)(calibration->sampling_period_s * MS_PER_S + 0.5f)
                          : DEFAULT_PERIOD_MS;
    loop->due_ms = 0u;
    loop->is_started = false;
    loop->is_in_lock_step = false;
    forget_phase(loop);
}

void ecu_loop_turn(ecu_loop_t *loop)
{
    can_frame_t frame;
    if (port_receive(&frame)) {
        take(loop, &frame);
    } else {
        port_idle(loop->is_started ? loop->due_ms : port_time_ms() + loop->period_ms);
    }
    follow_clock(loop);
}
