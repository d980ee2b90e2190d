/* Start of the Arm MPS2 board with a Cortex-M4F (AN386), as QEMU emulates it. */
#include <stdint.h>

#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xE000ED88u)
#define FLOATING_POINT (0xFu << 20)

extern void stack_top(void); /* of the linker script; an address only */
extern void _start(void);    /* newlib: clears memory, calls main, exits with its result */

static void reset(void)
{
    COPROCESSOR_ACCESS |= FLOATING_POINT;
    __asm__ volatile("dsb\n\tisb");
    _start();
}

static void fault(void)
{
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static void (*const VECTORS[16])(void) = {
    stack_top, reset, fault, fault, fault, fault, fault,
};
