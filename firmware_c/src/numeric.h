/* Comparisons on float32 that treat NaN as the bad case. */
#ifndef NUMERIC_H
#define NUMERIC_H

#include <float.h>
#include <stdbool.h>
#include <stdint.h>

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
