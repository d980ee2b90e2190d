/* The two functions of the C library that compilers call by themselves, as small as they get: what
 * is copied or set in a period is a frame at most. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    uint8_t *byte = to;
    for (const uint8_t *source = from; length > 0u; length--) {
        *byte++ = *source++;
    }
    return to;
}

void *memset(void *to, int value, size_t length)
{
    for (uint8_t *byte = to; length > 0u; length--) {
        *byte++ = (uint8_t)value;
    }
    return to;
}
