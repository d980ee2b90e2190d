/* Vector table and start-up of the boot stage and of the application. */
#include <stdint.h>

#include "registers.h"
#include "restart.h"

typedef void (*handler_t)(void);

/* Of the linker script; addresses only. */
extern void stack_top(void);
extern uint32_t zeroed_start;
extern uint32_t zeroed_end;
extern restart_record_t restart_record;

int main(void);
void reset_handler(void);
void fault_handler(void);
void watchdog_handler(void);

/* The boot stage has no interrupts and leaves these to the fault handler. */
void systick_handler(void) __attribute__((weak, alias("fault_handler")));
void uart0_receive_handler(void) __attribute__((weak, alias("fault_handler")));
void uart0_send_handler(void) __attribute__((weak, alias("fault_handler")));

__attribute__((section(".vectors"), used)) static const handler_t VECTORS[18] = {
    [0] = stack_top,
    [1] = reset_handler,
    [2] = watchdog_handler, /* non-maskable interrupt */
    [3] = fault_handler, /* hard fault; all other faults become one */
    [15] = systick_handler,
    [16] = uart0_receive_handler,
    [17] = uart0_send_handler,
};

/* There is no initialised data: a linker script that finds any refuses it. */
void reset_handler(void)
{
#ifdef __ARM_FP
    SCB_COPROCESSORS |= SCB_FLOATING_POINT;
    __asm__ volatile("dsb\n\tisb");
#endif
    for (uint32_t *word = &zeroed_start; word < &zeroed_end; word++) {
        *word = 0u;
    }
    (void)main();
    fault_handler();
}

/* Starting anew is safe: without the edge from off to charge the ECU commands 0 A. The handlers put
 * nothing on the stack, which may be what is broken. */
void fault_handler(void)
{
    restart_record.noted = RESTART_FAULT;
    SCB_RESET = SCB_RESET_REQUEST;
    for (;;) {
    }
}

void watchdog_handler(void)
{
    restart_record.noted = RESTART_WATCHDOG;
    SCB_RESET = SCB_RESET_REQUEST;
    for (;;) {
    }
}
