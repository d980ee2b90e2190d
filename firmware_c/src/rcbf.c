#include "rcbf.h"

#include <math.h>

#include "numeric.h"

/* Beyond these no input is physical, and none inside can make a product overflow. */
#define COLDEST_K 150.0f
#define HOTTEST_K 450.0f
#define LARGEST_LOW_PART_K (HOTTEST_K * FLT_EPSILON)
#define LOWEST_SOC (-0.1f)
#define HIGHEST_SOC 1.1f
#define LARGEST_INPUT 1e4f

/* constant + linear u + quadratic u^2 >= 0 with quadratic <= 0 */
typedef struct {
    float constant;
    float linear;
    float quadratic;
} concave_t;

typedef struct {
    float lower;
    float upper;
} interval_t;

static const interval_t EMPTY = { 1.0f, -1.0f };

/* The four constraints. A worst-case error term - |p + q u| e makes two concave functions of one,
 * of which the smaller holds. */
enum { VOLTAGE, SOC, CORE_ABOVE, CORE_BELOW, SURFACE_ABOVE, SURFACE_BELOW, FUNCTIONS };

/* Numbers that are close to each other subtract exactly, so that little is lost. */
static float difference_K(rcbf_temperature_t a, rcbf_temperature_t b)
{
    return (a.high_K - b.high_K) + (a.low_K - b.low_K);
}

static void split(concave_t nominal, float p, float q, float error_bound, concave_t pair[2])
{
    const float rest = p * error_bound;
    const float slope = q * error_bound;
    pair[0] = (concave_t){ nominal.constant - rest, nominal.linear - slope, nominal.quadratic };
    pair[1] = (concave_t){ nominal.constant + rest, nominal.linear + slope, nominal.quadratic };
}

static void build(const rcbf_constants_t *k, const rcbf_input_t *in, concave_t functions[FUNCTIONS])
{
    const float core_K = in->core_temperature_K.high_K;
    const float core_above_surface_K =
        difference_K(in->core_temperature_K, in->surface_temperature_K);
    const concave_t core = {
        k->a1_per_s * core_above_surface_K +
            k->alpha2_per_s * difference_K(k->max_core_temperature_K, in->core_temperature_K) -
            (k->core_uncertainty_K_per_s + k->core_margin_K_per_s),
        k->a2_per_As * core_K,
        -k->a3_K_per_A2s,
    };
    const concave_t surface = {
        k->a4_per_s2 * core_above_surface_K +
            k->a6_per_s2 * difference_K(in->coolant_temperature_K, in->surface_temperature_K) +
            k->alpha3_per_s2 *
                difference_K(k->max_surface_temperature_K, in->surface_temperature_K) +
            k->a10_K_per_Ws2 * in->cooling_power_W -
            (k->delta4_K_per_s2 + k->surface_margin_K_per_s2),
        k->a8_per_As2 * core_K,
        k->a9_K_per_A2s2,
    };
    const float e_K = k->estimation_error_bound_K;
    functions[VOLTAGE] = (concave_t){
        k->max_voltage_V - rcbf_open_circuit_voltage_V(k, in->soc) - k->voltage_margin_V,
        k->ohmic_resistance_ohm,
        0.0f,
    };
    functions[SOC] = (concave_t){
        k->alpha1_per_s * (k->max_soc - in->soc) - k->soc_uncertainty_per_s - k->soc_margin_per_s,
        1.0f / k->capacity_As,
        0.0f,
    };
    split(core, k->a1_per_s - k->alpha2_per_s, k->a2_per_As, e_K, &functions[CORE_ABOVE]);
    split(surface, k->a4_per_s2, k->a8_per_As2, e_K, &functions[SURFACE_ABOVE]);
}

/* Where a function with quadratic <= 0 is not negative. */
static interval_t admitted(const concave_t *f)
{
    interval_t interval = { -FLT_MAX, FLT_MAX };
    const float constant = f->constant;
    if (f->quadratic < 0.0f) {
        const float discriminant = f->linear * f->linear - 4.0f * f->quadratic * constant;
        if (!(discriminant >= 0.0f)) {
            return EMPTY;
        }
        /* Adds numbers of one sign only, so that no root loses digits. */
        const float root = sqrtf(discriminant);
        const float sum = -0.5f * (f->linear + ((f->linear < 0.0f) ? -root : root));
        const float first = sum / f->quadratic;
        const float second = (sum != 0.0f) ? (constant / sum) : 0.0f;
        interval.lower = (first < second) ? first : second;
        interval.upper = (first < second) ? second : first;
    } else if (f->linear > 0.0f) {
        interval.lower = -constant / f->linear;
    } else if (f->linear < 0.0f) {
        interval.upper = -constant / f->linear;
    } else if (!(constant >= 0.0f)) {
        interval = EMPTY;
    }
    return interval;
}

static float value_at(const concave_t *f, float u)
{
    return f->constant + u * (f->linear + u * f->quadratic);
}

static float smaller(float a, float b)
{
    return (a < b) ? a : b;
}

static bool is_within(float value, float low, float high)
{
    return (value >= low) && (value <= high);
}

/* The low part is what float32 cannot hold of the sum, no more. */
static bool is_temperature(rcbf_temperature_t temperature)
{
    return is_within(temperature.high_K, COLDEST_K, HOTTEST_K) &&
           is_within(temperature.low_K, -LARGEST_LOW_PART_K, LARGEST_LOW_PART_K);
}

static bool is_physical(const rcbf_input_t *in)
{
    return is_temperature(in->core_temperature_K) && is_temperature(in->surface_temperature_K) &&
           is_temperature(in->coolant_temperature_K) &&
           is_within(in->soc, LOWEST_SOC, HIGHEST_SOC) &&
           is_within(in->cooling_power_W, -LARGEST_INPUT, LARGEST_INPUT) &&
           is_within(in->reference_current_A, -LARGEST_INPUT, 0.0f);
}

rcbf_decision_t rcbf_solve(const rcbf_constants_t *constants, const rcbf_input_t *input)
{
    static const rcbf_active_t NAME[FUNCTIONS] = { RCBF_VOLTAGE, RCBF_SOC,     RCBF_CORE,
                                                   RCBF_CORE,    RCBF_SURFACE, RCBF_SURFACE };
    rcbf_decision_t decision = { 0.0f, false, RCBF_INVALID, 0.0f, 0.0f, { 0.0f } };
    if (!is_physical(input)) {
        return decision;
    }
    concave_t functions[FUNCTIONS];
    build(constants, input, functions);

    decision.active = RCBF_NONE;
    decision.lower_A = input->reference_current_A;
    for (uint32_t i = 0u; i < FUNCTIONS; i++) {
        const interval_t interval = admitted(&functions[i]);
        if (interval.lower > decision.lower_A) {
            decision.lower_A = interval.lower;
            decision.active = NAME[i];
        }
        if (interval.upper < decision.upper_A) {
            decision.upper_A = interval.upper;
        }
    }
    decision.feasible = decision.lower_A <= decision.upper_A;
    decision.current_A = decision.feasible ? decision.lower_A : 0.0f;
    if (!decision.feasible) {
        decision.active = RCBF_INFEASIBLE;
    }
    const float u = decision.current_A;
    decision.margins[0] = value_at(&functions[VOLTAGE], u);
    decision.margins[1] = value_at(&functions[SOC], u);
    decision.margins[2] = smaller(value_at(&functions[CORE_ABOVE], u),
                                  value_at(&functions[CORE_BELOW], u));
    decision.margins[3] = smaller(value_at(&functions[SURFACE_ABOVE], u),
                                  value_at(&functions[SURFACE_BELOW], u));
    return decision;
}

float rcbf_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc)
{
    const float *table_soc = constants->ocv_soc;
    const float *table_V = constants->ocv_V;
    uint32_t below = 0u;
    uint32_t above = constants->ocv_points - 1u;
    const float clamped = numeric_clamp(soc, table_soc[below], table_soc[above]);
    while (above - below > 1u) {
        const uint32_t middle = (below + above) / 2u;
        if (clamped > table_soc[middle]) {
            below = middle;
        } else {
            above = middle;
        }
    }
    const float slope_V =
        (table_V[above] - table_V[below]) / (table_soc[above] - table_soc[below]);
    return table_V[below] + slope_V * (clamped - table_soc[below]);
}

bool rcbf_constants_are_valid(const rcbf_constants_t *k)
{
    const float positive[] = { k->capacity_As,
                               k->ohmic_resistance_ohm,
                               k->max_voltage_V,
                               k->max_soc,
                               k->alpha1_per_s,
                               k->alpha2_per_s,
                               k->alpha3_per_s2,
                               k->a1_per_s,
                               k->a3_K_per_A2s,
                               -k->a9_K_per_A2s2,
                               k->a10_K_per_Ws2 };
    const float not_negative[] = { k->delta4_K_per_s2,          k->soc_uncertainty_per_s,
                                   k->core_uncertainty_K_per_s, k->estimation_error_bound_K,
                                   k->voltage_margin_V,         k->soc_margin_per_s,
                                   k->core_margin_K_per_s,      k->surface_margin_K_per_s2 };
    bool valid = numeric_is_finite(k->a2_per_As) && numeric_is_finite(k->a8_per_As2) &&
                 numeric_is_finite(k->a4_per_s2) && numeric_is_finite(k->a6_per_s2) &&
                 is_temperature(k->max_core_temperature_K) &&
                 is_temperature(k->max_surface_temperature_K);
    for (uint32_t i = 0u; i < sizeof positive / sizeof positive[0]; i++) {
        valid = valid && (positive[i] > 0.0f) && (positive[i] <= FLT_MAX);
    }
    for (uint32_t i = 0u; i < sizeof not_negative / sizeof not_negative[0]; i++) {
        valid = valid && (not_negative[i] >= 0.0f) && (not_negative[i] <= FLT_MAX);
    }
    return valid && (k->ocv_points >= 2u) && (k->ocv_points <= RCBF_MAX_OCV_POINTS) &&
           numeric_rises(k->ocv_soc, k->ocv_points) && numeric_rises(k->ocv_V, k->ocv_points);
}
