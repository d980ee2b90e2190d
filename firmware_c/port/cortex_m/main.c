/* The application of the microcontroller ports. */
#include "calibration.h"
#include "ecu_loop.h"
#include "image.h"
#include "port.h"
#include "restart.h"
#include "start.h"

/* Of the linker script; addresses only. */
extern const image_header_t image_calibration_start;
extern restart_record_t restart_record;

/* The boot stage has counted the start, and has held the hash against the calibration's bytes. */
static bms_start_t found_at_start(void)
{
    const bms_start_t start = {
        .calibration_content = image_calibration_start.content_hash,
        .reset_cause = (uint8_t)restart_record.cause,
        .reset_count = (uint8_t)restart_record.count,
    };
    return start;
}

/* A clock that stands still would hold all deadlines open, and is a hang like any other. */
static void feed_watchdog_at(uint32_t now_ms)
{
    static uint32_t fed_ms;
    if (now_ms != fed_ms) {
        fed_ms = now_ms;
        port_feed_watchdog();
    }
}

int main(void)
{
    static ecu_loop_t loop;
    const bms_start_t start = found_at_start();
    bool is_forgiven = false;
    ecu_loop_init(&loop, &BMS_DEFAULT_CALIBRATION);
    bms_tell_start(&loop.bms, &start);
    port_start();
    for (;;) {
        feed_watchdog_at(port_time_ms());
        ecu_loop_turn(&loop);
        if (!is_forgiven && (port_time_ms() >= RESTART_RUNS_AFTER_MS)) {
            restart_forgive(&restart_record);
            is_forgiven = true;
        }
    }
}
