/* The boot stage: starts the application when all parts are in order, else says why not, for good.
 *
 * It uses no interrupts and shares no code with the application, which may be damaged.
 */
#include <stdbool.h>
#include <stdint.h>

#include "image.h"
#include "refusal.h"
#include "registers.h"
#include "restart.h"
#include "slcan.h"

/* Of the linker script; addresses only. */
extern const uint8_t image_boot_start[];
extern const uint8_t image_boot_end[];
extern const uint8_t image_floor_start[];
extern const uint8_t image_floor_end[];
extern const uint8_t image_application_start[];
extern const uint8_t image_application_end[];
extern const uint8_t image_calibration_start[];
extern const uint8_t image_calibration_end[];
extern const uint8_t image_ram_start[];
extern const uint8_t image_ram_end[];
extern restart_record_t restart_record;

int main(void);

static image_memory_t memory_between(const uint8_t *start, const uint8_t *end)
{
    const image_memory_t memory = { start, (uint32_t)start, (uint32_t)end - (uint32_t)start };
    return memory;
}

/* From here on an application that hangs, or that never gets so far as to turn, restarts. */
static void start_watchdog(void)
{
    WATCHDOG->LOAD = CORE_CLOCK_HZ / 1000u * WATCHDOG_MS;
    WATCHDOG->CTRL = WATCHDOG_CTRL_INTERRUPT | WATCHDOG_CTRL_RESET;
}

static void start_application(const uint8_t *application)
{
    const uint32_t *vectors = (const uint32_t *)(const void *)&application[IMAGE_VECTORS_OFFSET];
    SCB_VECTOR_TABLE = (uint32_t)vectors;
    __asm__ volatile("dsb\n\tmsr msp, %0\n\tbx %1" : : "r"(vectors[0]), "r"(vectors[1]) : "memory");
}

static void send_byte(uint8_t byte)
{
    while ((UART0->STATE & UART_STATE_SEND_FULL) != 0u) {
    }
    UART0->DATA = byte;
}

static void await_period(void)
{
    while ((SYSTICK->CTRL & SYSTICK_HAS_COUNTED) == 0u) {
        if ((UART0->STATE & UART_STATE_RECEIVE_FULL) != 0u) {
            (void)UART0->DATA; /* nobody here listens, but the host must not wait */
        }
    }
}

__attribute__((noreturn)) static void refuse(refusal_part_t part, image_status_t status)
{
    UART0->BAUDDIV = UART_FASTEST_DIVIDER;
    UART0->CTRL = UART_CTRL_SEND | UART_CTRL_RECEIVE;
    SYSTICK->LOAD = CORE_CLOCK_HZ / 1000u * REFUSAL_PERIOD_MS - 1u; /* fits into its 24 bits */
    SYSTICK->VAL = 0u;
    SYSTICK->CTRL = SYSTICK_ENABLE | SYSTICK_CORE_CLOCK;
    for (uint32_t period = 0u;; period++) {
        can_frame_t frames[REFUSAL_FRAMES];
        refusal_frames(part, status, period, frames);
        for (uint32_t i = 0u; i < REFUSAL_FRAMES; i++) {
            uint8_t text[SLCAN_LONGEST_FRAME];
            const uint32_t length = slcan_print(&frames[i], text);
            for (uint32_t j = 0u; j < length; j++) {
                send_byte(text[j]);
            }
        }
        await_period();
    }
}

static image_status_t check_restarts(void)
{
    static const image_status_t HOPELESS[] = {
        [RESTART_POWER_ON] = IMAGE_OK,
        [RESTART_FAULT] = IMAGE_REPEATED_FAULTS,
        [RESTART_WATCHDOG] = IMAGE_REPEATED_WATCHDOG,
        [RESTART_OTHER] = IMAGE_REPEATED_RESETS,
    };
    return restart_is_hopeless(&restart_record) ? HOPELESS[restart_record.cause] : IMAGE_OK;
}

int main(void)
{
    restart_begin(&restart_record);
    const image_memory_t boot = memory_between(image_boot_start, image_boot_end);
    const image_memory_t floor = memory_between(image_floor_start, image_floor_end);
    const image_memory_t application =
        memory_between(image_application_start, image_application_end);
    const image_memory_t calibration =
        memory_between(image_calibration_start, image_calibration_end);
    const image_memory_t ram = memory_between(image_ram_start, image_ram_end);
    image_status_t status = image_check_boot(&boot);
    refusal_part_t part = REFUSAL_BOOT;
    if (status == IMAGE_OK) {
        status = image_check_application(&application, PORT_TARGET, &ram);
        part = REFUSAL_APPLICATION;
    }
    if (status == IMAGE_OK) {
        status = image_check_floor(
            &floor, (const image_header_t *)(const void *)image_application_start);
    }
    if (status == IMAGE_OK) {
        status = image_check_calibration(
            &calibration, (const image_header_t *)(const void *)image_application_start);
        part = REFUSAL_CALIBRATION;
    }
    if (status == IMAGE_OK) {
        status = check_restarts();
        part = REFUSAL_APPLICATION;
    }
    if (status == IMAGE_OK) {
        start_watchdog();
        start_application(image_application_start);
    }
    refuse(part, status);
}
