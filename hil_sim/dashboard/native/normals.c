#include "normals.h"

#include <math.h>
#include <stdbool.h>

#define POOL 4u
#define WORDS (POOL + 1u) /* the seed, filled up to the pool, and the child's number */

typedef struct {
    uint32_t constant;
    uint32_t factor;
} hash_t;

static uint32_t hashed(hash_t *hash, uint32_t value)
{
    value ^= hash->constant;
    hash->constant *= hash->factor;
    value *= hash->constant;
    return value ^ (value >> 16);
}

static uint32_t mixed(uint32_t into, uint32_t value)
{
    const uint32_t mix = 0xCA01F9DDu * into - 0x4973F715u * value;
    return mix ^ (mix >> 16);
}

static void seed_words(uint32_t seed, uint32_t child, uint64_t words[POOL])
{
    const uint32_t entropy[WORDS] = { seed, 0u, 0u, 0u, child };
    uint32_t pool[POOL];
    hash_t in = { 0x43B0D7E5u, 0x931E8875u };
    for (uint32_t i = 0u; i < POOL; i++) {
        pool[i] = hashed(&in, entropy[i]);
    }
    for (uint32_t from = 0u; from < POOL; from++) {
        for (uint32_t to = 0u; to < POOL; to++) {
            if (from != to) {
                pool[to] = mixed(pool[to], hashed(&in, pool[from]));
            }
        }
    }
    for (uint32_t to = 0u; to < POOL; to++) {
        pool[to] = mixed(pool[to], hashed(&in, entropy[POOL]));
    }
    hash_t out = { 0x8B51F9DDu, 0x58F38DEDu };
    for (uint32_t i = 0u; i < POOL; i++) {
        const uint64_t low = hashed(&out, pool[(2u * i) % POOL]);
        const uint64_t high = hashed(&out, pool[(2u * i + 1u) % POOL]);
        words[i] = low | (high << 32);
    }
}

/* sum += addend, modulo 2^128 */
static void add(uint64_t sum[2], const uint64_t addend[2])
{
    sum[0] += addend[0];
    sum[1] += addend[1] + ((sum[0] < addend[0]) ? 1u : 0u);
}

/* The upper half of a product. */
static uint64_t high_product(uint64_t a, uint64_t b)
{
    const uint64_t a0 = a & 0xFFFFFFFFu;
    const uint64_t b0 = b & 0xFFFFFFFFu;
    const uint64_t a1 = a >> 32;
    const uint64_t b1 = b >> 32;
    const uint64_t middle = a1 * b0 + ((a0 * b0) >> 32);
    const uint64_t carry = a0 * b1 + (middle & 0xFFFFFFFFu);
    return a1 * b1 + (middle >> 32) + (carry >> 32);
}

static void step(normals_t *normals)
{
    const uint64_t factor[2] = { UINT64_C(0x4385DF649FCCF645), UINT64_C(0x2360ED051FC65DA4) };
    uint64_t *state = normals->state;
    const uint64_t low = state[0] * factor[0];
    const uint64_t high =
        high_product(state[0], factor[0]) + state[0] * factor[1] + state[1] * factor[0];
    state[0] = low;
    state[1] = high;
    add(state, normals->increment);
}

static uint64_t next_bits(normals_t *normals)
{
    step(normals);
    const uint64_t high = normals->state[1];
    const uint64_t folded = high ^ normals->state[0];
    const uint32_t turn = (uint32_t)(high >> 58);
    return (folded >> turn) | (folded << ((64u - turn) & 63u));
}

/* Evenly distributed from 0 to below 1. */
static double next_even(normals_t *normals)
{
    return (double)(next_bits(normals) >> 11) * 0x1p-53;
}

void normals_begin(normals_t *normals, const normals_tables_t *tables, uint32_t seed,
                   uint32_t child)
{
    uint64_t words[POOL];
    seed_words(seed, child, words);
    normals->tables = tables;
    const uint64_t start[2] = { words[1], words[0] };
    normals->increment[0] = (words[3] << 1) | 1u;
    normals->increment[1] = (words[2] << 1) | (words[3] >> 63);
    normals->state[0] = 0u;
    normals->state[1] = 0u;
    step(normals);
    add(normals->state, start);
    step(normals);
}

static double in_tail(normals_t *normals, bool is_negative)
{
    const normals_tables_t *tables = normals->tables;
    for (;;) {
        const double beyond = -tables->tail_inverse * log1p(-next_even(normals));
        const double height = -log1p(-next_even(normals));
        if (height + height > beyond * beyond) {
            return is_negative ? -(tables->tail + beyond) : tables->tail + beyond;
        }
    }
}

double normals_next(normals_t *normals)
{
    const normals_tables_t *tables = normals->tables;
    for (;;) {
        const uint64_t bits = next_bits(normals);
        const uint32_t strip = (uint32_t)(bits & 0xFFu);
        const bool is_negative = ((bits >> 8) & 1u) != 0u;
        const uint64_t place = (bits >> 9) & UINT64_C(0x000FFFFFFFFFFFFF);
        const double strength = (double)place * tables->step[strip];
        const double value = is_negative ? -strength : strength;
        if (place < tables->inside[strip]) {
            return value;
        }
        if (strip == 0u) {
            return in_tail(normals, ((place >> 8) & 1u) != 0u);
        }
        const double below = tables->density[strip];
        const double above = tables->density[strip - 1u];
        if ((above - below) * next_even(normals) + below < exp(-0.5 * value * value)) {
            return value;
        }
    }
}
