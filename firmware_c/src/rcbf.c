#include "rcbf.h"

#include <math.h>

#include "numeric.h"

/* Beyond these no input is physical, and none inside can make a product overflow. */
#define COLDEST_K 150.0
#define HOTTEST_K 450.0
#define LOWEST_SOC (-0.1)
#define HIGHEST_SOC 1.1
#define LARGEST_INPUT 1e4

/* constant + linear u + quadratic u^2 >= 0 with quadratic <= 0 */
typedef struct {
    double constant;
    float linear;
    float quadratic;
} concave_t;

typedef struct {
    float lower;
    float upper;
} interval_t;

static const interval_t EMPTY = { 1.0f, -1.0f };

/* A constraint with a worst-case error term - |p + q u| e is the smaller of two concave ones. */
typedef struct {
    concave_t branch[2];
} constraint_t;

static constraint_t plain(concave_t function)
{
    const constraint_t constraint = { { function, function } };
    return constraint;
}

static constraint_t with_error(concave_t nominal, double p, float q, double error_bound)
{
    constraint_t constraint = plain(nominal);
    const float slope = q * (float)error_bound;
    constraint.branch[0].constant -= p * error_bound;
    constraint.branch[0].linear -= slope;
    constraint.branch[1].constant += p * error_bound;
    constraint.branch[1].linear += slope;
    return constraint;
}

static void build(const rcbf_constants_t *k, const rcbf_input_t *in,
                  constraint_t constraints[RCBF_CONSTRAINTS])
{
    const double core_K = in->core_temperature_K;
    const double surface_K = in->surface_temperature_K;
    const double core_above_surface_K = core_K - surface_K;
    const float voltage_V = k->max_voltage_V - rcbf_open_circuit_voltage_V(k, in->soc) -
                            k->voltage_margin_V;
    const float soc_per_s = k->alpha1_per_s * (k->max_soc - in->soc) - k->soc_uncertainty_per_s -
                            k->soc_margin_per_s;

    const concave_t voltage = { (double)voltage_V, k->ohmic_resistance_ohm, 0.0f };
    const concave_t soc = { (double)soc_per_s, 1.0f / k->capacity_As, 0.0f };
    const concave_t core = {
        k->a1_per_s * core_above_surface_K + k->alpha2_per_s * (k->max_core_temperature_K - core_K) -
            k->core_uncertainty_K_per_s - k->core_margin_K_per_s,
        k->a2_per_As * (float)core_K,
        -k->a3_K_per_A2s,
    };
    const concave_t surface = {
        k->a4_per_s2 * core_above_surface_K +
            k->a6_per_s2 * (in->coolant_temperature_K - surface_K) +
            k->alpha3_per_s2 * (k->max_surface_temperature_K - surface_K) +
            k->a10_K_per_Ws2 * (double)in->cooling_power_W - k->delta4_K_per_s2 -
            k->surface_margin_K_per_s2,
        k->a8_per_As2 * (float)core_K,
        k->a9_K_per_A2s2,
    };
    const double e_K = k->estimation_error_bound_K;
    constraints[0] = plain(voltage);
    constraints[1] = plain(soc);
    constraints[2] = with_error(core, k->a1_per_s - k->alpha2_per_s, k->a2_per_As, e_K);
    constraints[3] = with_error(surface, k->a4_per_s2, k->a8_per_As2, e_K);
}

/* Where a function with quadratic <= 0 is not negative. */
static interval_t admitted(const concave_t *f)
{
    interval_t interval = { -FLT_MAX, FLT_MAX };
    const float constant = (float)f->constant;
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
    return (float)f->constant + u * (f->linear + u * f->quadratic);
}

static bool is_within(double value, double low, double high)
{
    return (value >= low) && (value <= high);
}

static bool is_physical(const rcbf_input_t *in)
{
    return is_within(in->core_temperature_K, COLDEST_K, HOTTEST_K) &&
           is_within(in->surface_temperature_K, COLDEST_K, HOTTEST_K) &&
           is_within(in->coolant_temperature_K, COLDEST_K, HOTTEST_K) &&
           is_within((double)in->soc, LOWEST_SOC, HIGHEST_SOC) &&
           is_within((double)in->cooling_power_W, -LARGEST_INPUT, LARGEST_INPUT) &&
           is_within((double)in->reference_current_A, -LARGEST_INPUT, 0.0);
}

rcbf_decision_t rcbf_solve(const rcbf_constants_t *constants, const rcbf_input_t *input)
{
    static const rcbf_active_t NAME[RCBF_CONSTRAINTS] = { RCBF_VOLTAGE, RCBF_SOC, RCBF_CORE,
                                                          RCBF_SURFACE };
    rcbf_decision_t decision = { 0.0f, false, RCBF_INVALID, 0.0f, 0.0f, { 0.0f } };
    if (!is_physical(input)) {
        return decision;
    }
    constraint_t constraints[RCBF_CONSTRAINTS];
    build(constants, input, constraints);

    decision.active = RCBF_NONE;
    decision.lower_A = input->reference_current_A;
    for (uint32_t i = 0u; i < RCBF_CONSTRAINTS; i++) {
        for (uint32_t b = 0u; b < 2u; b++) {
            const interval_t interval = admitted(&constraints[i].branch[b]);
            if (interval.lower > decision.lower_A) {
                decision.lower_A = interval.lower;
                decision.active = NAME[i];
            }
            if (interval.upper < decision.upper_A) {
                decision.upper_A = interval.upper;
            }
        }
    }
    decision.feasible = decision.lower_A <= decision.upper_A;
    decision.current_A = decision.feasible ? decision.lower_A : 0.0f;
    if (!decision.feasible) {
        decision.active = RCBF_INFEASIBLE;
    }
    for (uint32_t i = 0u; i < RCBF_CONSTRAINTS; i++) {
        const float a = value_at(&constraints[i].branch[0], decision.current_A);
        const float b = value_at(&constraints[i].branch[1], decision.current_A);
        decision.margins[i] = (a < b) ? a : b;
    }
    return decision;
}

float rcbf_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc)
{
    const uint32_t last = constants->ocv_points - 1u;
    const float clamped = numeric_clamp(soc, constants->ocv_soc[0], constants->ocv_soc[last]);
    uint32_t i = 1u;
    while ((i < last) && (clamped > constants->ocv_soc[i])) {
        i++;
    }
    const float slope_V = (constants->ocv_V[i] - constants->ocv_V[i - 1u]) /
                          (constants->ocv_soc[i] - constants->ocv_soc[i - 1u]);
    return constants->ocv_V[i - 1u] + slope_V * (clamped - constants->ocv_soc[i - 1u]);
}

bool rcbf_constants_are_valid(const rcbf_constants_t *k)
{
    const double positive[] = { (double)k->capacity_As,    (double)k->ohmic_resistance_ohm,
                                (double)k->max_voltage_V,  (double)k->max_soc,
                                (double)k->alpha1_per_s,   k->alpha2_per_s,
                                k->alpha3_per_s2,          k->max_core_temperature_K,
                                k->a1_per_s,               (double)k->a3_K_per_A2s,
                                -(double)k->a9_K_per_A2s2, k->a10_K_per_Ws2,
                                k->max_surface_temperature_K };
    const double not_negative[] = { k->delta4_K_per_s2,          (double)k->soc_uncertainty_per_s,
                                    k->core_uncertainty_K_per_s, k->estimation_error_bound_K,
                                    (double)k->voltage_margin_V, (double)k->soc_margin_per_s,
                                    k->core_margin_K_per_s,      k->surface_margin_K_per_s2 };
    bool valid = numeric_is_finite(k->a2_per_As) && numeric_is_finite(k->a8_per_As2) &&
                 numeric_is_finite((float)k->a4_per_s2) && numeric_is_finite((float)k->a6_per_s2);
    for (uint32_t i = 0u; i < sizeof positive / sizeof positive[0]; i++) {
        valid = valid && (positive[i] > 0.0) && (positive[i] <= (double)FLT_MAX);
    }
    for (uint32_t i = 0u; i < sizeof not_negative / sizeof not_negative[0]; i++) {
        valid = valid && (not_negative[i] >= 0.0) && (not_negative[i] <= (double)FLT_MAX);
    }
    return valid && (k->ocv_points >= 2u) && (k->ocv_points <= RCBF_MAX_OCV_POINTS) &&
           numeric_rises(k->ocv_soc, k->ocv_points) && numeric_rises(k->ocv_V, k->ocv_points);
}
