#include "planner.h"

#include <math.h>
#include <stddef.h>

#include "family_tables.h"
#include "numeric.h"

#define SEARCH_EVERY_S 10.0f
/* Predictions of a search beside that of the plan in force; golden section leaves 0.618 of the
 * interval with each. */
#define CANDIDATES 14u
#define GOLDEN 0.618034f
/* The interval, in shares of the strongest current: a little beyond it, so that it is tried too. */
#define LEAST_SHARE 0.02f
#define MOST_SHARE 1.1f
/* Once there is a plan the search is for a better one up to this many times as strong or weak. */
#define NEAR 2.0f
/* A prediction that takes longer is given up. */
#define LONGEST_S 36000.0f
/* More than any strength: what is in time is better than all that is late. */
#define IN_TIME (-1e4f)

enum { CORE, SURFACE, COOLANT, HEAT, COOLING };

/* Behind the two inner candidates of the search. */
#define IN_FORCE 2u

bool planner_constants_are_valid(const planner_constants_t *constants)
{
    static const numeric_field_t FIELDS[] = {
        { (uint16_t)offsetof(planner_constants_t, period_s),
          (uint16_t)(offsetof(planner_constants_t, response) / sizeof(float)), NUMERIC_LEAST,
          FLT_MAX },
        { (uint16_t)offsetof(planner_constants_t, response), PLANNER_MASSES * PLANNER_DRIVES,
          -FLT_MAX, FLT_MAX },
    };
    return numeric_fields_are_within(constants, FIELDS, NUMERIC_COUNT(FIELDS)) &&
           (constants->step_s >= constants->period_s);
}

void planner_reset(planner_t *planner)
{
    /* What a search needs, it sets when it begins. */
    planner->is_searching = false;
    planner->age_s = SEARCH_EVERY_S;
    planner->planned_A = NAN;
    planner->time_to_full_s = NAN;
}

bool planner_is_due(const planner_t *planner)
{
    return !planner->is_searching && (planner->age_s >= SEARCH_EVERY_S);
}

/* Largest strength with constant - slope v - square v^2 >= 0. */
static float curved_A(float constant, float slope, float square)
{
    const float discriminant = slope * slope + 4.0f * square * constant;
    return (discriminant >= 0.0f) ? ((sqrtf(discriminant) - slope) / (2.0f * square)) : 0.0f;
}

/* What the conditions of one cell leave (rcbf.c), but for the error of the estimate in the reversible
 * heat, a thousandth of it. */
static float cell_limit_A(const planner_t *planner, const rcbf_constants_t *k, float step_s)
{
    const float *above_K = planner->temperature_K;
    const float e_K = k->estimation_error_bound_K;
    const float core_K = k->max_core_temperature_K.high_K + above_K[CORE];
    const float core_above_surface_K = above_K[CORE] - above_K[SURFACE];
    const float surface_room_K =
        (k->max_surface_temperature_K.high_K - k->max_core_temperature_K.high_K) -
        above_K[SURFACE];
    /* In the mean of the step, in which the charge goes on. */
    const float soc_A = k->capacity_As *
                        (k->alpha1_per_s * (k->max_soc - planner->soc) -
                         k->soc_uncertainty_per_s - k->soc_margin_per_s) /
                        (1.0f + 0.5f * k->alpha1_per_s * step_s);
    const float core_A =
        curved_A(k->a1_per_s * core_above_surface_K - k->alpha2_per_s * above_K[CORE] -
                   k->core_uncertainty_K_per_s - k->core_margin_K_per_s -
                   fabsf(k->a1_per_s - k->alpha2_per_s) * e_K,
               k->a2_per_As * core_K, k->a3_K_per_A2s);
    const float surface_A =
        curved_A(k->a4_per_s2 * core_above_surface_K +
                   k->a6_per_s2 * (above_K[COOLANT] - above_K[SURFACE]) +
                   k->alpha3_per_s2 * surface_room_K +
                   k->a10_K_per_Ws2 * planner->start.cooling_power_W - k->delta4_K_per_s2 -
                   k->surface_margin_K_per_s2 - fabsf(k->a4_per_s2) * e_K,
               k->a8_per_As2 * core_K, -k->a9_K_per_A2s2);
    return numeric_smaller(soc_A, numeric_smaller(core_A, surface_A));
}

/* What the conditions of a family leave (family_decision.c). */
static float family_limit_A(const planner_t *planner, const rcbf_constants_t *k,
                            const family_constants_t *family)
{
    const float *above_K = planner->temperature_K;
    const float outflow_W = family->outflow_W_per_K * (above_K[CORE] - above_K[SURFACE]) -
                            family->gain_W_per_K * (above_K[CORE] + family->inner_K) -
                            family->disturbance_W - family->hold_W;
    const float core_A = curved_A(outflow_W, planner->start.entropic_V + family->disturbance_W_per_A,
                                planner->resistance_ohm + family->disturbance_W_per_A2);
    return numeric_smaller(core_A,
                  family_mapped_A(&family->map,
                                  k->max_core_temperature_K.high_K + above_K[SURFACE],
                                  planner->soc));
}

/* What is left of a family's resistance: a cell that has warmed up resists less. */
static float left_of_resistance(const planner_t *planner, const rcbf_constants_t *cell,
                                const family_constants_t *family)
{
    const float surface_K = cell->max_core_temperature_K.high_K + planner->temperature_K[SURFACE];
    return (family->is_stated != 0u) ? (family_resistance_ohm(family, surface_K) /
                                        planner->start.family_resistance_ohm)
                                     : 1.0f;
}

/* What flows in the mean of the next step of a prediction. */
static float next_strength_A(planner_t *planner, const planner_constants_t *constants,
                             const rcbf_constants_t *cell, const family_constants_t *family)
{
    const float left = left_of_resistance(planner, cell, family);
    planner->resistance_ohm = left * planner->start.resistance_ohm;
    /* In the middle of the step, if it goes on as before. */
    const float middle_soc =
        planner->soc + 0.5f * constants->step_s * planner->strength_A * planner->start.soc_per_As;
    const float room_V = cell->max_voltage_V - cell->voltage_margin_V -
                         rcbf_open_circuit_voltage_near_V(cell, middle_soc, &planner->ocv_segment);
    const float voltage_A = room_V / (left * planner->start.total_ohm);
    const float limit_A = (family->is_stated != 0u) ? family_limit_A(planner, cell, family)
                                                    : cell_limit_A(planner, cell, constants->step_s);
    const float allowed_A =
        numeric_smaller(numeric_smaller(limit_A, voltage_A), planner->strength_A + constants->growth_A);
    return numeric_clamp(allowed_A, 0.0f, planner->inner[planner->trying].strength_A);
}

static void advance(planner_t *planner, const planner_constants_t *constants, float strength_A)
{
    const planner_start_t *start = &planner->start;
    const float heat_W = strength_A * (planner->resistance_ohm * strength_A + start->entropic_V);
    const float *row = constants->response;
    float next_K[PLANNER_MASSES];
    for (uint32_t i = 0u; i < PLANNER_MASSES; i++) {
        next_K[i] = row[CORE] * planner->temperature_K[CORE] +
                    row[SURFACE] * planner->temperature_K[SURFACE] +
                    row[COOLANT] * planner->temperature_K[COOLANT] +
                    row[HEAT] * heat_W + row[COOLING] * start->cooling_power_W;
        row += PLANNER_DRIVES;
    }
    for (uint32_t i = 0u; i < PLANNER_MASSES; i++) {
        planner->temperature_K[i] = next_K[i];
    }
    planner->strength_A = strength_A;
    planner->elapsed_s += constants->step_s;
}

static void begin_prediction(planner_t *planner, uint8_t which, float strength_A)
{
    for (uint32_t i = 0u; i < PLANNER_MASSES; i++) {
        planner->temperature_K[i] = planner->start.temperature_K[i];
    }
    planner->soc = planner->start.soc;
    planner->strength_A = planner->start.strength_A;
    planner->elapsed_s = 0.0f;
    planner->trying = which;
    planner->inner[which].strength_A = numeric_smaller(strength_A, planner->goal.strongest_A);
}

/* The other two thirds of the interval lie beside each inner candidate. */
static void begin_inner(planner_t *planner, uint8_t which)
{
    const float part_A = GOLDEN * (planner->high_A - planner->low_A);
    begin_prediction(planner, which,
                     (which == 0u) ? (planner->high_A - part_A) : (planner->low_A + part_A));
}

static bool is_known(const planner_t *planner)
{
    static const numeric_field_t FIELDS[] = {
        { (uint16_t)offsetof(planner_t, start),
          (uint16_t)((sizeof(planner_start_t) + sizeof(planner_goal_t)) / sizeof(float)), -FLT_MAX,
          FLT_MAX },
    };
    return numeric_fields_are_within(planner, FIELDS, NUMERIC_COUNT(FIELDS)) &&
           (planner->start.resistance_ohm > 0.0f) && (planner->goal.strongest_A > 0.0f);
}

void planner_begin(planner_t *planner)
{
    if (!is_known(planner)) {
        planner_reset(planner);
        return;
    }
    planner->is_searching = true;
    planner->age_s = 0.0f;
    planner->tried = 0u;
    planner->ocv_segment = 0u;
    planner->best.cost = FLT_MAX;
    const float planned_A = planner->planned_A;
    const float strongest_A = planner->goal.strongest_A;
    planner->low_A = LEAST_SHARE * strongest_A;
    planner->high_A = MOST_SHARE * strongest_A;
    if (planned_A > planner->low_A) {
        /* The time has more than one least: what is in force stays until something beats it. */
        planner->low_A = numeric_larger(planner->low_A,
                                        numeric_smaller(planned_A, strongest_A) / NEAR);
        planner->high_A = numeric_smaller(planner->high_A, planned_A * NEAR);
        begin_prediction(planner, IN_FORCE, planned_A);
    } else {
        begin_inner(planner, 0u);
    }
}

static void end_prediction(planner_t *planner, float time_s)
{
    planner_candidate_t *inner = planner->inner;
    planner_candidate_t *candidate = &inner[planner->trying];
    candidate->time_s = time_s;
    candidate->cost = (time_s <= planner->goal.time_left_s) ? (candidate->strength_A + IN_TIME)
                                                            : time_s;
    if (candidate->cost <= planner->best.cost) {
        planner->best = *candidate;
    }
    const bool is_found = planner->best.cost < FLT_MAX;
    if (is_found && !numeric_is_finite(planner->time_to_full_s)) {
        /* Heat of the first seconds is missed to the end: the best so far is better than none. */
        planner->planned_A = planner->best.strength_A;
    }
    if (planner->trying == IN_FORCE) {
        begin_inner(planner, 0u);
        return;
    }
    planner->tried++;
    /* Of two that are worth the same the stronger one is taken: the limits are the filter's. */
    if (planner->tried == 1u) {
        begin_inner(planner, 1u);
    } else if (planner->tried >= CANDIDATES) {
        /* The best one is the plan until the next search has ended. */
        planner->is_searching = false;
        planner->planned_A = is_found ? planner->best.strength_A : NAN;
        planner->time_to_full_s = is_found ? (planner->best.time_s - planner->age_s) : NAN;
    } else if (inner[0].cost < inner[1].cost) {
        planner->high_A = inner[1].strength_A;
        inner[1] = inner[0];
        begin_inner(planner, 0u);
    } else {
        planner->low_A = inner[0].strength_A;
        inner[0] = inner[1];
        begin_inner(planner, 1u);
    }
}

/* Whether the prediction can still become the best. */
static bool is_hopeful(const planner_t *planner)
{
    const float elapsed_s = planner->elapsed_s;
    return (elapsed_s <= LONGEST_S) &&
           ((elapsed_s <= planner->goal.time_left_s) || (elapsed_s <= planner->best.cost));
}

void planner_step(planner_t *planner, const planner_constants_t *constants,
                  const rcbf_constants_t *cell, const family_constants_t *family)
{
    planner->age_s += constants->period_s;
    planner->time_to_full_s -= constants->period_s;
    for (uint32_t i = 0u; planner->is_searching && (i < PLANNER_STEPS); i++) {
        const float strength_A = next_strength_A(planner, constants, cell, family);
        const float charged = strength_A * constants->step_s * planner->start.soc_per_As;
        const float missing = constants->completion_soc - planner->soc;
        if (!is_hopeful(planner)) {
            end_prediction(planner, FLT_MAX);
        } else if (charged >= missing) {
            /* A family may have to prove what its count says already. */
            end_prediction(planner, planner->elapsed_s +
                                        constants->step_s * numeric_larger(missing / charged, 0.0f));
        } else {
            planner->soc += charged;
            advance(planner, constants, strength_A);
        }
    }
}

float planner_reference_A(const planner_t *planner, float reference_A)
{
    const float planned_A = -planner->planned_A;
    return ((planned_A > reference_A) && (planned_A <= 0.0f)) ? planned_A : reference_A;
}
