/* Pseudo-random numbers from a seed: xorshift64* (Vigna 2016). */
#ifndef RANDOM_H
#define RANDOM_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint64_t state; /* not zero */
} random_t;

static inline uint32_t random_bits(random_t *random)
{
    random->state ^= random->state >> 12u;
    random->state ^= random->state << 25u;
    random->state ^= random->state >> 27u;
    return (uint32_t)((random->state * UINT64_C(0x2545F4914F6CDD1D)) >> 32u);
}

static inline uint32_t random_below(random_t *random, uint32_t bound)
{
    return random_bits(random) % bound;
}

/* True in `share` of 1024 cases. */
static inline bool random_chance(random_t *random, uint32_t share)
{
    return random_below(random, 1024u) < share;
}

static inline float random_between(random_t *random, float low, float high)
{
    return low + (high - low) * (float)random_below(random, 65536u) / 65535.0f;
}

#endif
