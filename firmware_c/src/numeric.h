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

static inline bool numeric_is_finite(float value)
{
    return (value >= -FLT_MAX) && (value <= FLT_MAX);
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

static inline float numeric_abs(float value)
{
    return (value < 0.0f) ? -value : value;
}

static inline bool numeric_all_finite(const float *values, uint32_t count)
{
    bool finite = true;
    for (uint32_t i = 0u; i < count; i++) {
        finite = finite && numeric_is_finite(values[i]);
    }
    return finite;
}

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
