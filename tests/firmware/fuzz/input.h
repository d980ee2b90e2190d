/* An input of a fuzzer taken apart, and the oracle's voice. */
#ifndef INPUT_H
#define INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const uint8_t *bytes;
    size_t left;
} input_t;

/* What an input that has ended gives is 0. */
static inline uint8_t input_byte(input_t *input)
{
    if (input->left == 0u) {
        return 0u;
    }
    input->left--;
    return *input->bytes++;
}

static inline uint16_t input_16(input_t *input)
{
    const uint32_t low = input_byte(input);
    return (uint16_t)(low | (uint32_t)input_byte(input) << 8u);
}

static inline uint32_t input_32(input_t *input)
{
    const uint32_t low = input_16(input);
    return low | (uint32_t)input_16(input) << 16u;
}

/* Overwrites words of memory: how many, then offset in words and new value of each. */
static inline void input_patch(input_t *input, uint8_t *memory, size_t length)
{
    for (uint32_t left = input_byte(input); left > 0u; left--) {
        const size_t offset = 4u * (size_t)input_16(input);
        const uint32_t word = input_32(input);
        if ((offset <= length) && (length - offset >= 4u)) {
            memcpy(&memory[offset], &word, 4u);
        }
    }
}

/* Ends the process, which is a finding, unless what must hold does. */
#define MUST(holds, finding)                             \
    do {                                                 \
        if (!(holds)) {                                  \
            fprintf(stderr, "oracle: %s\n", (finding));  \
            abort();                                     \
        }                                                \
    } while (0)

/* What a fuzzer calls for each input; 0. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

#endif
