/* The port of the MPS2 boards: slcan on UART 0, a millisecond by the system timer. */
#include "port.h"

#include "registers.h"
#include "slcan_link.h"
#include "start.h"

static slcan_link_t serial;
static volatile uint32_t time_ms;

void systick_handler(void);
void uart0_receive_handler(void);
void uart0_send_handler(void);

void systick_handler(void)
{
    time_ms++;
}

/* The flag is cleared before the buffer is emptied, so that no byte comes between unseen. */
void uart0_receive_handler(void)
{
    UART0->INTSTATUS = UART_INT_RECEIVE;
    while ((UART0->STATE & UART_STATE_RECEIVE_FULL) != 0u) {
        slcan_link_put(&serial, (uint8_t)UART0->DATA);
    }
}

void uart0_send_handler(void)
{
    uint8_t byte;
    UART0->INTSTATUS = UART_INT_SEND;
    while (((UART0->STATE & UART_STATE_SEND_FULL) == 0u) && slcan_link_get(&serial, &byte)) {
        UART0->DATA = byte;
    }
}

static void mask_interrupts(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

static void unmask_interrupts(void)
{
    __asm__ volatile("cpsie i" ::: "memory");
}

/* The first byte of a pause has no interrupt before it. */
static void start_sending(void)
{
    mask_interrupts();
    uart0_send_handler();
    unmask_interrupts();
}

void port_start(void)
{
    UART0->BAUDDIV = UART_FASTEST_DIVIDER;
    UART0->CTRL = UART_CTRL_SEND | UART_CTRL_RECEIVE | UART_CTRL_SEND_INTERRUPT |
                  UART_CTRL_RECEIVE_INTERRUPT;
    NVIC_ENABLE = 0x3u;
    SYSTICK->LOAD = CORE_CLOCK_HZ / 1000u - 1u;
    SYSTICK->VAL = 0u;
    SYSTICK->CTRL = SYSTICK_ENABLE | SYSTICK_INTERRUPT | SYSTICK_CORE_CLOCK;
}

void port_feed_watchdog(void)
{
    WATCHDOG->INTCLR = 1u;
}

bool port_receive(can_frame_t *frame)
{
    const bool is_received = slcan_link_receive(&serial, frame);
    start_sending(); /* answers to commands */
    return is_received;
}

void port_send(const can_frame_t *frame)
{
    slcan_link_send(&serial, frame);
    start_sending();
}

uint32_t port_time_ms(void)
{
    return time_ms;
}

/* With interrupts masked nothing can come between check and sleep; one that waits ends the sleep.
 * The timer ends it every millisecond, so that until_ms needs no further care. */
void port_idle(uint32_t until_ms)
{
    (void)until_ms;
    mask_interrupts();
    if (slcan_link_is_quiet(&serial)) {
        __asm__ volatile("wfi");
    }
    unmask_interrupts();
}
