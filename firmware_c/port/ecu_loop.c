#include "ecu_loop.h"

#include <stddef.h>

#include "port.h"

#define MS_PER_S 1000.0f
#define DEFAULT_PERIOD_MS 100u

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

static void take(ecu_loop_t *loop, const can_frame_t *frame)
{
    bms_receive(&loop->bms, frame);
    if (frame->id == ECU_LOOP_SYNC_ID) {
        step(loop);
        loop->due_ms = port_time_ms() + ECU_LOOP_SYNC_SILENCE_MS;
    } else if (!loop->is_started) {
        loop->due_ms = port_time_ms() + loop->period_ms / 2u;
    }
    loop->is_started = true;
}

/* After a stall, missed periods are not caught up. */
static void follow_clock(ecu_loop_t *loop)
{
    const uint32_t now_ms = port_time_ms();
    if (!loop->is_started || !is_reached(now_ms, loop->due_ms)) {
        return;
    }
    loop->due_ms += loop->period_ms;
    if (is_reached(now_ms, loop->due_ms)) {
        loop->due_ms = now_ms;
    }
    step(loop);
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
