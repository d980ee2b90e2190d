#include "sha256.h"

#define BLOCK_BYTES 64u
#define LENGTH_FROM 56u /* where a last block holds the number of bits */
#define ROUNDS 64u
#define SCHEDULE_WORDS 16u
#define PADDING_START 0x80u

/* First 32 bits of the fractional parts of the cube roots of the first 64 primes. */
static const uint32_t ROUND_CONSTANTS[ROUNDS] = {
    0x428A2F98u, 0x71374491u, 0xB5C0FBCFu, 0xE9B5DBA5u, 0x3956C25Bu, 0x59F111F1u,
    0x923F82A4u, 0xAB1C5ED5u, 0xD807AA98u, 0x12835B01u, 0x243185BEu, 0x550C7DC3u,
    0x72BE5D74u, 0x80DEB1FEu, 0x9BDC06A7u, 0xC19BF174u, 0xE49B69C1u, 0xEFBE4786u,
    0x0FC19DC6u, 0x240CA1CCu, 0x2DE92C6Fu, 0x4A7484AAu, 0x5CB0A9DCu, 0x76F988DAu,
    0x983E5152u, 0xA831C66Du, 0xB00327C8u, 0xBF597FC7u, 0xC6E00BF3u, 0xD5A79147u,
    0x06CA6351u, 0x14292967u, 0x27B70A85u, 0x2E1B2138u, 0x4D2C6DFCu, 0x53380D13u,
    0x650A7354u, 0x766A0ABBu, 0x81C2C92Eu, 0x92722C85u, 0xA2BFE8A1u, 0xA81A664Bu,
    0xC24B8B70u, 0xC76C51A3u, 0xD192E819u, 0xD6990624u, 0xF40E3585u, 0x106AA070u,
    0x19A4C116u, 0x1E376C08u, 0x2748774Cu, 0x34B0BCB5u, 0x391C0CB3u, 0x4ED8AA4Au,
    0x5B9CCA4Fu, 0x682E6FF3u, 0x748F82EEu, 0x78A5636Fu, 0x84C87814u, 0x8CC70208u,
    0x90BEFFFAu, 0xA4506CEBu, 0xBEF9A3F7u, 0xC67178F2u,
};

/* The same of the square roots of the first eight. */
static const uint32_t START[SHA256_WORDS] = {
    0x6A09E667u, 0xBB67AE85u, 0x3C6EF372u, 0xA54FF53Au, 0x510E527Fu, 0x9B05688Cu,
    0x1F83D9ABu, 0x5BE0CD19u,
};

static uint32_t rotated(uint32_t word, uint32_t bits)
{
    return (word >> bits) | (word << (32u - bits));
}

/* Byte `at` of the padded message; the number of bits fits into its last four bytes and one bit. */
static uint8_t padded_byte(const uint8_t *bytes, uint32_t length, uint32_t at, uint32_t end)
{
    if (at < length) {
        return bytes[at];
    }
    if (at == length) {
        return PADDING_START;
    }
    const uint32_t from_end = end - 1u - at;
    if (from_end < sizeof(uint32_t)) {
        return (uint8_t)((length << 3u) >> (8u * from_end));
    }
    return (from_end == sizeof(uint32_t)) ? (uint8_t)(length >> 29u) : 0u;
}

static void take_block(const uint8_t *bytes, uint32_t length, uint32_t start, uint32_t end,
                       uint32_t digest[SHA256_WORDS])
{
    uint32_t w[SCHEDULE_WORDS];
    uint32_t s[SHA256_WORDS];
    for (uint32_t i = 0u; i < SHA256_WORDS; i++) {
        s[i] = digest[i];
    }
    for (uint32_t i = 0u; i < ROUNDS; i++) {
        uint32_t *const word = &w[i % SCHEDULE_WORDS];
        if (i < SCHEDULE_WORDS) {
            *word = 0u;
            for (uint32_t j = 0u; j < sizeof(uint32_t); j++) {
                *word = (*word << 8u) | padded_byte(bytes, length, start + 4u * i + j, end);
            }
        } else {
            const uint32_t a = w[(i + 1u) % SCHEDULE_WORDS];
            const uint32_t b = w[(i + 14u) % SCHEDULE_WORDS];
            *word += (rotated(a, 7u) ^ rotated(a, 18u) ^ (a >> 3u)) + w[(i + 9u) % SCHEDULE_WORDS] +
                     (rotated(b, 17u) ^ rotated(b, 19u) ^ (b >> 10u));
        }
        const uint32_t one = s[7] + (rotated(s[4], 6u) ^ rotated(s[4], 11u) ^ rotated(s[4], 25u)) +
                             ((s[4] & s[5]) ^ (~s[4] & s[6])) + ROUND_CONSTANTS[i] + *word;
        const uint32_t other = (rotated(s[0], 2u) ^ rotated(s[0], 13u) ^ rotated(s[0], 22u)) +
                               ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
        for (uint32_t j = SHA256_WORDS - 1u; j > 0u; j--) {
            s[j] = s[j - 1u];
        }
        s[4] += one;
        s[0] = one + other;
    }
    for (uint32_t i = 0u; i < SHA256_WORDS; i++) {
        digest[i] += s[i];
    }
}

void sha256(const uint8_t *bytes, uint32_t length, uint32_t digest[SHA256_WORDS])
{
    /* Whole blocks that hold the bytes, the mark behind them and the number of bits. */
    const uint32_t end =
        ((length + (BLOCK_BYTES - LENGTH_FROM)) / BLOCK_BYTES + 1u) * BLOCK_BYTES;
    for (uint32_t i = 0u; i < SHA256_WORDS; i++) {
        digest[i] = START[i];
    }
    for (uint32_t start = 0u; start < end; start += BLOCK_BYTES) {
        take_block(bytes, length, start, end, digest);
    }
}
