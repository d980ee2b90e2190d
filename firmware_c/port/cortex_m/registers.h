/* The few registers that the ports of the Arm MPS2 boards use. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

/* Both boards run at 25 MHz. */
#define CORE_CLOCK_HZ 25000000u

/* CMSDK APB UART. */
typedef struct {
    volatile uint32_t DATA;
    volatile uint32_t STATE;
    volatile uint32_t CTRL;
    volatile uint32_t INTSTATUS; /* write 1 to clear */
    volatile uint32_t BAUDDIV;
} uart_registers_t;

#define UART0 ((uart_registers_t *)0x40004000u)
#define UART_STATE_SEND_FULL 0x1u
#define UART_STATE_RECEIVE_FULL 0x2u
#define UART_CTRL_SEND 0x1u
#define UART_CTRL_RECEIVE 0x2u
#define UART_CTRL_SEND_INTERRUPT 0x4u
#define UART_CTRL_RECEIVE_INTERRUPT 0x8u
#define UART_INT_SEND 0x1u
#define UART_INT_RECEIVE 0x2u
#define UART_FASTEST_DIVIDER 16u

/* CMSDK APB watchdog: its first step is the non-maskable interrupt, its second one a reset. */
typedef struct {
    volatile uint32_t LOAD;
    volatile uint32_t VALUE;
    volatile uint32_t CTRL;
    volatile uint32_t INTCLR; /* any write clears the first step and begins the time anew */
} watchdog_registers_t;

#define WATCHDOG ((watchdog_registers_t *)0x40008000u)
#define WATCHDOG_CTRL_INTERRUPT 0x1u
#define WATCHDOG_CTRL_RESET 0x2u
/* Long for a loop that turns every millisecond: a machine that emulates the board may be busy. */
#define WATCHDOG_MS 2000u

/* Armv7-M system timer. */
typedef struct {
    volatile uint32_t CTRL;
    volatile uint32_t LOAD;
    volatile uint32_t VAL;
} systick_registers_t;

#define SYSTICK ((systick_registers_t *)0xE000E010u)
#define SYSTICK_ENABLE 0x1u
#define SYSTICK_INTERRUPT 0x2u
#define SYSTICK_CORE_CLOCK 0x4u
#define SYSTICK_HAS_COUNTED 0x10000u

/* Armv7-M system control. */
#define NVIC_ENABLE (*(volatile uint32_t *)0xE000E100u)
#define SCB_VECTOR_TABLE (*(volatile uint32_t *)0xE000ED08u)
#define SCB_RESET (*(volatile uint32_t *)0xE000ED0Cu)
#define SCB_RESET_REQUEST 0x05FA0004u
#define SCB_COPROCESSORS (*(volatile uint32_t *)0xE000ED88u)
#define SCB_FLOATING_POINT 0x00F00000u

#endif
