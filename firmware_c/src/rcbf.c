#include "rcbf.h"

#include <math.h>
#include <stddef.h>

#include "numeric.h"

/* Beyond these no input is physical, and none inside can make a product overflow. */
#define COLDEST_K 150.0f
#define HOTTEST_K 450.0f
#define LARGEST_LOW_PART_K (HOTTEST_K * FLT_EPSILON)
#define LOWEST_SOC (-0.1f)
#define HIGHEST_SOC 1.1f
#define LARGEST_INPUT 1e4f

/* Smallest of the constants that are positive: far below any cell's, and no product of it with
 * LEAST_CONSTANT underflows. */
#define LEAST_POSITIVE 1e-20f
/* A constraint that leaves less than this at 0 A is solved whatever its value is elsewhere. */
#define LEAST_CONSTANT 1e-12f
/* Share of its terms that a function has to be above 0, for its roots to be left alone. */
#define CLEARLY 1e-5f

/* Of the way to the present reading that a steadied condition goes in a period, and what it keeps
 * below it on average, as a share of the margin; that much noise does not move it at once. */
#define STEADY_SHARE 0.2f
#define STEADY_RESERVE 0.125f

/* constant + linear u >= 0 with linear > 0 */
typedef struct {
    float constant;
    float linear;
} line_t;

/* constant + linear u + quadratic u^2 >= 0 with quadratic < 0 */
typedef struct {
    float constant;
    float linear;
    float quadratic;
} concave_t;

/* Currents that all constraints so far admit, and the one that the lower end is from. */
typedef struct {
    float lower_A;
    float upper_A;
    rcbf_active_t active;
} interval_t;

/* A constraint with a worst-case error term: mean - |rest + slope u| >= 0. */
typedef struct {
    concave_t mean;
    float rest;
    float slope;
} robust_t;

/* Numbers that are close to each other subtract exactly, so that little is lost. */
static float difference_K(rcbf_temperature_t a, rcbf_temperature_t b)
{
    return (a.high_K - b.high_K) + (a.low_K - b.low_K);
}

NUMERIC_INLINE line_t voltage_left(const rcbf_constants_t *k, float open_circuit_voltage_V)
{
    return (line_t){
        k->max_voltage_V - open_circuit_voltage_V - k->voltage_margin_V,
        k->ohmic_resistance_ohm,
    };
}

NUMERIC_INLINE line_t soc_left(const rcbf_constants_t *k, const rcbf_input_t *in)
{
    return (line_t){
        k->alpha1_per_s * (k->max_soc - in->soc) - k->soc_uncertainty_per_s - k->soc_margin_per_s,
        1.0f / k->capacity_As,
    };
}

NUMERIC_INLINE robust_t core_left(const rcbf_constants_t *k, const rcbf_input_t *in)
{
    const float e_K = k->estimation_error_bound_K;
    return (robust_t){
        {
            k->a1_per_s * difference_K(in->core_temperature_K, in->surface_temperature_K) +
                k->alpha2_per_s * difference_K(k->max_core_temperature_K, in->core_temperature_K) -
                (k->core_uncertainty_K_per_s + k->core_margin_K_per_s),
            k->a2_per_As * in->core_temperature_K.high_K,
            -k->a3_K_per_A2s,
        },
        (k->a1_per_s - k->alpha2_per_s) * e_K,
        k->a2_per_As * e_K,
    };
}

NUMERIC_INLINE robust_t surface_left(const rcbf_constants_t *k, const rcbf_input_t *in)
{
    const float e_K = k->estimation_error_bound_K;
    return (robust_t){
        {
            k->a4_per_s2 * difference_K(in->core_temperature_K, in->surface_temperature_K) +
                k->a6_per_s2 * difference_K(in->coolant_temperature_K, in->surface_temperature_K) +
                k->alpha3_per_s2 *
                    difference_K(k->max_surface_temperature_K, in->surface_temperature_K) +
                k->a10_K_per_Ws2 * in->cooling_power_W -
                (k->delta4_K_per_s2 + k->surface_margin_K_per_s2),
            k->a8_per_As2 * in->core_temperature_K.high_K,
            k->a9_K_per_A2s2,
        },
        k->a4_per_s2 * e_K,
        k->a8_per_As2 * e_K,
    };
}

/* The two functions of which the smaller is a constraint with its error term. */
NUMERIC_INLINE concave_t less_error(const robust_t *f)
{
    return (concave_t){ f->mean.constant - f->rest, f->mean.linear - f->slope,
                        f->mean.quadratic };
}

NUMERIC_INLINE concave_t plus_error(const robust_t *f)
{
    return (concave_t){ f->mean.constant + f->rest, f->mean.linear + f->slope,
                        f->mean.quadratic };
}

NUMERIC_INLINE float value_at(concave_t f, float u)
{
    return f.constant + u * (f.linear + u * f.quadratic);
}

NUMERIC_INLINE float least_value_at(const robust_t *f, float u)
{
    return numeric_smaller(value_at(less_error(f), u), value_at(plus_error(f), u));
}

/* An end that is no number leaves nothing, and stays: no later end lies beyond it. */
NUMERIC_INLINE void raise_lower(interval_t *to, float lower_A, rcbf_active_t name)
{
    if (!(lower_A <= to->lower_A)) {
        to->lower_A = (lower_A <= FLT_MAX) ? lower_A : FLT_MAX;
        to->active = name;
    }
}

/* Takes what a function does not admit from an interval. */
static void narrow(interval_t *to, concave_t f, rcbf_active_t name)
{
    float lower_A = 1.0f;
    float upper_A = -1.0f;
    const float discriminant = f.linear * f.linear - 4.0f * f.quadratic * f.constant;
    if (discriminant >= 0.0f) {
        /* Adds numbers of one sign only, so that no root loses digits. */
        const float root = sqrtf(discriminant);
        const float sum = -0.5f * (f.linear + ((f.linear < 0.0f) ? -root : root));
        const float first = sum / f.quadratic;
        const float second = (sum != 0.0f) ? (f.constant / sum) : 0.0f;
        lower_A = (first < second) ? first : second;
        upper_A = (first < second) ? second : first;
    }
    raise_lower(to, lower_A, name);
    if (!(upper_A >= to->upper_A)) {
        to->upper_A = (upper_A >= -FLT_MAX) ? upper_A : -FLT_MAX;
    }
}

/* The end of what a line that rises with u admits. */
NUMERIC_INLINE void narrow_by_line(interval_t *to, line_t f, rcbf_active_t name)
{
    raise_lower(to, -f.constant / f.linear, name);
}

/* Narrows by both functions of a constraint with an error term, but for those that leave all.
 *
 * A concave function that is above 0 at 0 A and at u is so between them, and has its roots beyond
 * both. So have their computed values if it is above 0 by enough. With S the sum of the magnitudes
 * of its constant and quadratic terms at u, the value at u is off by 12 roundings of S at most; a
 * root r, which is off by 5 roundings of itself, is as far from u as value / sqrt(discriminant) at
 * least, and |r| sqrt(discriminant) <= 4 S where |r| < 2 |u|. So a value of 32 roundings of S is
 * enough; the constant of either function is at most twice that of the mean, which makes it 64, or
 * 4e-6 of the mean's S. The upper function lies above the lower one, and its S is no larger nearer
 * to 0. A number that is none fails each comparison. */
NUMERIC_INLINE void narrow_by_both(interval_t *to, const robust_t *f, rcbf_active_t name)
{
    const float quadratic = f->mean.quadratic;
    const float u = numeric_smaller(to->lower_A, 0.0f);
    const bool is_above = f->rest + u * f->slope < 0.0f;
    const float rest = is_above ? -f->rest : f->rest;
    const float slope = is_above ? -f->slope : f->slope;
    const float enough = CLEARLY * (f->mean.constant - u * u * quadratic);
    const bool is_open = f->mean.constant - fabsf(rest) > LEAST_CONSTANT;
    const concave_t lower = { f->mean.constant - rest, f->mean.linear - slope, quadratic };
    if (is_open && (value_at(lower, u) > enough)) {
        return;
    }
    narrow(to, lower, name);
    const concave_t upper = { f->mean.constant + rest, f->mean.linear + slope, quadratic };
    if (!(is_open && (value_at(upper, numeric_smaller(to->lower_A, 0.0f)) > enough))) {
        narrow(to, upper, name);
    }
}

/* Whether the magnitude is, for a largest one from 0 up; the sign is shifted out. */
NUMERIC_INLINE bool is_no_larger(float value, float largest)
{
    return (numeric_bits(value) << 1u) <= (numeric_bits(largest) << 1u);
}

/* The low part is what float32 cannot hold of the sum, no more. */
NUMERIC_INLINE bool is_temperature(rcbf_temperature_t temperature)
{
    return (numeric_bits(temperature.high_K) - numeric_bits(COLDEST_K) <=
            numeric_bits(HOTTEST_K) - numeric_bits(COLDEST_K)) &&
           is_no_larger(temperature.low_K, LARGEST_LOW_PART_K);
}

NUMERIC_INLINE bool is_physical(const rcbf_input_t *in)
{
    return is_temperature(in->core_temperature_K) && is_temperature(in->surface_temperature_K) &&
           is_temperature(in->coolant_temperature_K) && (in->soc >= LOWEST_SOC) &&
           (in->soc <= HIGHEST_SOC) && is_no_larger(in->cooling_power_W, LARGEST_INPUT) &&
           is_no_larger(in->reference_current_A, LARGEST_INPUT) &&
           (in->reference_current_A <= 0.0f);
}

void rcbf_steadier_reset(rcbf_steadier_t *steadier)
{
    *steadier = (rcbf_steadier_t){ FLT_MAX, FLT_MAX };
}

/* What a condition leaves at 0 A, steadied: never more than the reading says, so that only current
 * is lost by it. What is no number gives way to the reading. */
static void steady(float *kept, concave_t *f, float margin)
{
    *kept += STEADY_SHARE * (f->constant - STEADY_RESERVE * margin - *kept);
    if (!(*kept <= f->constant)) {
        *kept = f->constant;
    }
    f->constant = *kept;
}

rcbf_decision_t rcbf_solve(const rcbf_constants_t *constants, const rcbf_input_t *input)
{
    rcbf_steadier_t none;
    rcbf_steadier_reset(&none);
    return rcbf_solve_steadily(constants, input,
                               rcbf_open_circuit_voltage_V(constants, input->soc), &none);
}

rcbf_decision_t rcbf_solve_steadily(const rcbf_constants_t *constants, const rcbf_input_t *input,
                                    float open_circuit_voltage_V, rcbf_steadier_t *steadier)
{
    if (!is_physical(input)) {
        return (rcbf_decision_t){ .active = RCBF_INVALID };
    }
    const line_t voltage = voltage_left(constants, open_circuit_voltage_V);
    const line_t soc = soc_left(constants, input);
    robust_t robust[2] = { core_left(constants, input), surface_left(constants, input) };
    steady(&steadier->core_K_per_s, &robust[0].mean, constants->core_margin_K_per_s);
    steady(&steadier->surface_K_per_s2, &robust[1].mean, constants->surface_margin_K_per_s2);
    interval_t interval = { input->reference_current_A, 0.0f, RCBF_NONE };
    narrow_by_line(&interval, voltage, RCBF_VOLTAGE);
    narrow_by_line(&interval, soc, RCBF_SOC);
    for (uint32_t i = 0u; i < 2u; i++) {
        narrow_by_both(&interval, &robust[i], (i == 0u) ? RCBF_CORE : RCBF_SURFACE);
    }
    rcbf_decision_t decision;
    decision.lower_A = interval.lower_A;
    decision.upper_A = interval.upper_A;
    decision.feasible = interval.lower_A <= interval.upper_A;
    decision.active = decision.feasible ? interval.active : RCBF_INFEASIBLE;
    const float u = decision.feasible ? interval.lower_A : 0.0f;
    decision.current_A = u;
    decision.margins[0] = voltage.constant + u * voltage.linear;
    decision.margins[1] = soc.constant + u * soc.linear;
    decision.margins[2] = least_value_at(&robust[0], u);
    decision.margins[3] = least_value_at(&robust[1], u);
    return decision;
}

NUMERIC_INLINE float ocv_V(const rcbf_constants_t *constants, uint32_t segment, float soc)
{
    const float *at = &constants->ocv_soc[segment];
    const float *at_V = &constants->ocv_V[segment];
    const float slope_V = (at_V[1] - at_V[0]) / (at[1] - at[0]);
    return at_V[0] + slope_V * (soc - at[0]);
}

NUMERIC_INLINE float within_table(const rcbf_constants_t *constants, float soc)
{
    return numeric_clamp(soc, constants->ocv_soc[0],
                         constants->ocv_soc[constants->ocv_points - 1u]);
}

float rcbf_open_circuit_voltage_near_V(const rcbf_constants_t *constants, float soc,
                                       uint8_t *segment)
{
    const float clamped = within_table(constants, soc);
    uint32_t at = *segment;
    if (clamped > constants->ocv_soc[at + 1u]) {
        at++; /* there is one, since the last point is not below what is clamped to it */
    }
    const float *start = &constants->ocv_soc[at];
    if (!((clamped > start[0]) && (clamped <= start[1]))) {
        at = numeric_segment(constants->ocv_soc, constants->ocv_points, clamped);
    }
    *segment = (uint8_t)at;
    return ocv_V(constants, at, clamped);
}

float rcbf_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc)
{
    const float clamped = within_table(constants, soc);
    return ocv_V(constants,
                 numeric_segment(constants->ocv_soc, constants->ocv_points, clamped), clamped);
}

#define AT(member) ((uint16_t)offsetof(rcbf_constants_t, member))

bool rcbf_constants_are_valid(const rcbf_constants_t *k)
{
    static const uint16_t POSITIVE[] = {
        AT(capacity_As),  AT(ohmic_resistance_ohm), AT(max_voltage_V), AT(max_soc),
        AT(alpha1_per_s), AT(alpha2_per_s),         AT(alpha3_per_s2), AT(a1_per_s),
        AT(a3_K_per_A2s), AT(a10_K_per_Ws2),
    };
    static const uint16_t NOT_NEGATIVE[] = {
        AT(delta4_K_per_s2),          AT(soc_uncertainty_per_s),    AT(core_uncertainty_K_per_s),
        AT(estimation_error_bound_K), AT(voltage_margin_V),         AT(soc_margin_per_s),
        AT(core_margin_K_per_s),      AT(surface_margin_K_per_s2),
    };
    static const uint16_t ANY[] = { AT(a2_per_As), AT(a8_per_As2), AT(a4_per_s2), AT(a6_per_s2) };
    return is_temperature(k->max_core_temperature_K) &&
           is_temperature(k->max_surface_temperature_K) &&
           numeric_members_are_within(k, POSITIVE, NUMERIC_COUNT(POSITIVE), LEAST_POSITIVE,
                                      FLT_MAX) &&
           numeric_members_are_within(k, NOT_NEGATIVE, NUMERIC_COUNT(NOT_NEGATIVE), 0.0f,
                                      FLT_MAX) &&
           numeric_members_are_within(k, ANY, NUMERIC_COUNT(ANY), -FLT_MAX, FLT_MAX) &&
           numeric_is_within(k->a9_K_per_A2s2, -FLT_MAX, -LEAST_POSITIVE) && (k->ocv_points >= 2u) && (k->ocv_points <= RCBF_MAX_OCV_POINTS) &&
           numeric_rises(k->ocv_soc, k->ocv_points) && numeric_rises(k->ocv_V, k->ocv_points);
}
