#include "semihosting.h"

#include <string.h>

enum { OPEN = 0x01, WRITE = 0x05, READ = 0x06, GET_COMMAND_LINE = 0x15, EXIT_EXTENDED = 0x20 };

static uint32_t call(uint32_t operation, const void *arguments)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = arguments;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void semihosting_command_line(char *text, uint32_t size)
{
    const uint32_t arguments[] = { (uint32_t)text, size };
    (void)call(GET_COMMAND_LINE, arguments);
}

int32_t semihosting_open(const char *path, semihosting_mode_t mode)
{
    const uint32_t arguments[] = { (uint32_t)path, (uint32_t)mode, strlen(path) };
    return (int32_t)call(OPEN, arguments);
}

uint32_t semihosting_read(int32_t handle, void *data, uint32_t size)
{
    const uint32_t arguments[] = { (uint32_t)handle, (uint32_t)data, size };
    return size - call(READ, arguments);
}

uint32_t semihosting_write(int32_t handle, const void *data, uint32_t size)
{
    const uint32_t arguments[] = { (uint32_t)handle, (uint32_t)data, size };
    return call(WRITE, arguments);
}

void semihosting_exit(uint32_t status)
{
    const uint32_t arguments[] = { 0x20026u, status };
    (void)call(EXIT_EXTENDED, arguments);
}
