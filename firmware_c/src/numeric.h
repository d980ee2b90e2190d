/* Comparisons on float32 that treat NaN as the bad case. */
#ifndef NUMERIC_H
#define NUMERIC_H

#include <float.h>
#include <stdbool.h>
#include <stdint.h>

/* Where a call costs more than what it calls; other compilers decide themselves. */
#if defined(__GNUC__) && (!defined(__arm__) || defined(__ARM_FP))
#define NUMERIC_INLINE __attribute__((always_inline)) static inline
#else
#define NUMERIC_INLINE static inline
#endif

/* Where many call what is not small. */
#if defined(__GNUC__) && defined(__arm__)
#define NUMERIC_APART __attribute__((noinline, unused)) static
#else
#define NUMERIC_APART static inline
#endif

#define NUMERIC_INFINITY_BITS 0x7F800000u
/* Least number above 0 that float32 has. */
#define NUMERIC_LEAST 0x1p-149f

/* Numbers from 0 up compare as their bits do, and NaN comes after all of them. */
NUMERIC_INLINE uint32_t numeric_bits(float value)
{
    const union {
        float value;
        uint32_t bits;
    } both = { value };
    return both.bits;
}

/* The sign is shifted out. */
static inline bool numeric_is_finite(float value)
{
    return (numeric_bits(value) << 1u) < (NUMERIC_INFINITY_BITS << 1u);
}

/* By the sign, which -0 and NaN have too. */
NUMERIC_INLINE bool numeric_is_negative(float value)
{
    return (numeric_bits(value) >> 31u) != 0u;
}

NUMERIC_INLINE float numeric_larger(float a, float b)
{
    return (a > b) ? a : b;
}

NUMERIC_INLINE float numeric_smaller(float a, float b)
{
    return (a < b) ? a : b;
}

/* False for NaN. */
NUMERIC_APART bool numeric_is_within(float value, float low, float high)
{
    return (value >= low) && (value <= high);
}

/* low for NaN. */
static inline float numeric_clamp(float value, float low, float high)
{
    if (!(value >= low)) {
        return low;
    }
    return (value <= high) ? value : high;
}

/* Of the segments of a rising axis of two points or more, the start of that which holds `at`: the
 * last point below it, or the first one of all. */
NUMERIC_INLINE uint32_t numeric_segment(const float *axis, uint32_t points, float at)
{
    uint32_t segments = points - 1u;
    const float *start = axis;
    do {
        const uint32_t half = segments / 2u;
        segments -= half;
        if (at > start[half]) {
            start += half;
        }
    } while (segments > 1u);
    return (uint32_t)(start - axis);
}

static inline bool numeric_all_finite(const float *values, uint32_t count)
{
    bool finite = true;
    for (uint32_t i = 0u; i < count; i++) {
        finite = finite && numeric_is_finite(values[i]);
    }
    return finite;
}

/* True when the members of a structure at these offsets, all of them float, are within. */
static inline bool numeric_members_are_within(const void *structure, const uint16_t *offsets,
                                              uint32_t count, float low, float high)
{
    bool within = true;
    for (uint32_t i = 0u; i < count; i++) {
        const void *member = (const uint8_t *)structure + offsets[i];
        within = within && numeric_is_within(*(const float *)member, low, high);
    }
    return within;
}

/* Consecutive members of a structure, all of them float, and what they must be within. */
typedef struct {
    uint16_t place;
    uint16_t count;
    float low;
    float high;
} numeric_field_t;

/* For NaN in any member, too, false. */
static inline bool numeric_fields_are_within(const void *structure, const numeric_field_t *field,
                                             uint32_t fields)
{
    bool within = true;
    for (const numeric_field_t *const end = &field[fields]; field < end; field++) {
        const float *member = (const float *)(const void *)((const uint8_t *)structure + field->place);
        for (uint32_t i = 0u; i < field->count; i++) {
            within = within && numeric_is_within(member[i], field->low, field->high);
        }
    }
    return within;
}

#define NUMERIC_COUNT(array) ((uint32_t)(sizeof(array) / sizeof (array)[0]))

/* True when the values are finite and each is above the one before. */
static inline bool numeric_rises(const float *values, uint32_t count)
{
    bool rises = numeric_all_finite(values, count);
    for (uint32_t i = 1u; i < count; i++) {
        rises = rises && (values[i] > values[i - 1u]);
    }
    return rises;
}

#endif
