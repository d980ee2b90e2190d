/* The two functions of the C library that compilers call by themselves, as small as they get: in a
 * period nothing longer than a frame is copied or set. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* What these functions move may be of any type. */
typedef uint32_t __attribute__((may_alias)) word_t;

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    uint8_t *byte = to;
    const uint8_t *source = from;
    if ((((uintptr_t)to | (uintptr_t)from) % sizeof(word_t)) == 0u) {
        for (; length >= sizeof(word_t); length -= sizeof(word_t)) {
            *(word_t *)(void *)byte = *(const word_t *)(const void *)source;
            byte += sizeof(word_t);
            source += sizeof(word_t);
        }
    }
    for (; length > 0u; length--) {
        *byte++ = *source++;
    }
    return to;
}

void *memset(void *to, int value, size_t length)
{
    uint8_t *const byte = to;
    while (length > 0u) {
        length--;
        byte[length] = (uint8_t)value;
    }
    return to;
}
