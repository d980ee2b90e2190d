/* Any bytes as constants: what is taken is a number within its bounds, and nothing else is read. */
#include "proof.h"

#include <float.h>

#include "planner.h"
#include "rcbf.h"
#include "thermal.h"

static bool is_number(float value)
{
    return (value >= -FLT_MAX) && (value <= FLT_MAX);
}

int main(void)
{
    ANY(rcbf_constants_t, cell);
    ANY(planner_constants_t, planner);
    ANY(thermal_constants_t, thermal);
    ANY(planner_t, plan);
    ANY(float, reference_A);
    ANY(uint32_t, at);
    if (rcbf_constants_are_valid(&cell)) {
        HOLDS((cell.capacity_As > 0.0f) && is_number(cell.capacity_As), "capacity");
        HOLDS((cell.ohmic_resistance_ohm > 0.0f) && is_number(cell.ohmic_resistance_ohm),
              "resistance");
        HOLDS(cell.a9_K_per_A2s2 < 0.0f, "current heats the surface");
        HOLDS(cell.a3_K_per_A2s > 0.0f, "and the core");
        HOLDS((cell.voltage_margin_V >= 0.0f) && (cell.estimation_error_bound_K >= 0.0f),
              "no margin is negative");
        HOLDS((cell.ocv_points >= 2u) && (cell.ocv_points <= RCBF_MAX_OCV_POINTS), "points");
        GRANTED(at < cell.ocv_points - 1u);
        HOLDS((cell.ocv_soc[at] < cell.ocv_soc[at + 1u]) && (cell.ocv_V[at] < cell.ocv_V[at + 1u]),
              "the table rises at every point");
    }
    if (planner_constants_are_valid(&planner)) {
        HOLDS((planner.period_s > 0.0f) && (planner.step_s >= planner.period_s), "steps");
        GRANTED(at < PLANNER_MASSES * PLANNER_DRIVES);
        HOLDS(is_number(planner.response[at]), "every response is a number");
    }
    if (thermal_constants_are_valid(&thermal)) {
        HOLDS(is_number(thermal.error_bound_K) && (thermal.error_bound_K >= 0.0f), "a bound");
        HOLDS(is_number(thermal.ohmic_resistance_ohm), "a resistance");
    }
    const float used_A = planner_reference_A(&plan, reference_A);
    HOLDS(!(reference_A <= 0.0f) || ((used_A >= reference_A) && (used_A <= 0.0f)),
          "a plan only weakens what is asked for");
    return 0;
}
