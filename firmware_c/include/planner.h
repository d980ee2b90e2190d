/* The current to ask for: the constant one with which the cell is full soonest while its limits are
 * ridden, or the least with which it is full in a given time.
 *
 * Nothing relies on a plan. It only weakens what a charger asks for, and the filter behind it keeps
 * the limits whatever is asked for; so a wrong plan makes a charge slow, never unsafe. Strengths are
 * charging currents as positive numbers.
 */
#ifndef PLANNER_H
#define PLANNER_H

#include <stdbool.h>
#include <stdint.h>

#include "family.h"
#include "rcbf.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PLANNER_MASSES 3
#define PLANNER_DRIVES 5

/* Steps of a prediction in one period: what a period can cost is bounded by them. */
#define PLANNER_STEPS 28

/* Core, surface and coolant over one step of a prediction, inputs held: each has a row of what the
 * three of them (K per K), the heat and the cooling power (K per W) make of it. */
typedef struct {
    float period_s; /* of control */
    float step_s;
    float growth_A; /* most that a charging current may grow by in a step */
    float completion_soc;
    float response[PLANNER_MASSES * PLANNER_DRIVES];
} planner_constants_t;

/* The cell when a search begins. Temperatures are above the core's limit. */
typedef struct {
    float temperature_K[PLANNER_MASSES];
    float soc;
    float soc_per_As;
    float strength_A; /* half a step ago, as far as growth is concerned */
    float cooling_power_W;
    float resistance_ohm; /* that heats */
    float total_ohm;      /* that takes voltage */
    float family_resistance_ohm; /* greatest of the family at this temperature; else not used */
    float entropic_V;     /* reversible heat for each ampere */
} planner_start_t;

typedef struct {
    float strongest_A;
    float time_left_s; /* in which to be full; below 0 for as soon as possible */
} planner_goal_t;

/* A strength, what it is worth (less is better), and how long it takes. */
typedef struct {
    float strength_A;
    float cost;
    float time_s;
} planner_candidate_t;

typedef struct {
    bool is_searching;
    uint8_t tried;
    uint8_t trying; /* which of the candidates */
    uint8_t ocv_segment; /* of the table, where the last search for a voltage ended */
    float age_s;    /* since the search began */
    planner_start_t start;
    planner_goal_t goal;
    /* Golden section between low and high. */
    float low_A;
    float high_A;
    planner_candidate_t inner[3]; /* the last is the plan in force */
    planner_candidate_t best;
    /* The prediction under way. */
    float temperature_K[PLANNER_MASSES];
    float soc;
    float strength_A;
    float resistance_ohm;
    float elapsed_s;
    /* What is in force; NaN without a plan. */
    float planned_A;
    float time_to_full_s;
} planner_t;

bool planner_constants_are_valid(const planner_constants_t *constants);

/* There is no plan. */
void planner_reset(planner_t *planner);

/* Whether the next search should begin, from readings of now. */
bool planner_is_due(const planner_t *planner);

/* Begins a search from start and goal, which the caller has filled in. Where they are not finite
 * there is no plan. */
void planner_begin(planner_t *planner);

/* One period: some steps of a prediction. */
void planner_step(planner_t *planner, const planner_constants_t *constants,
                  const rcbf_constants_t *cell, const family_constants_t *family);

/* The weaker one of a reference (negative, in A) and the plan: the reference where there is none. */
float planner_reference_A(const planner_t *planner, float reference_A);

#ifdef __cplusplus
}
#endif

#endif
