#include "bms_growth.h"

#include "bms_symptoms.h"
#include "numeric.h"

/* Shares of the preset's growth: with which the current rises after it has met a limit, and what is
 * added in each period without one. */
#define LEAST_GROWTH 0.0067f
#define GROWTH_RISE 0.0133f
/* Of the preset's strongest current, by which it rises in a period once a charge has come to what
 * was asked for or to a limit. */
#define MOST_RISE 0.006f
/* With which the current falls to a weaker plan. */
#define PLAN_FALL 0.25f

float bms_wanted_current_A(const bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    const float asked_A = bms->measurement.reference_current_A;
    const float planned_A =
        numeric_smaller(bms->command_A + PLAN_FALL * calibration->current_growth_A,
                        planner_reference_A(&bms->planner, asked_A));
    const float allowed_A = numeric_larger(calibration->reference_current_A,
                                           bms->command_A - bms->growth_A);
    /* A request that is no number has to come last, to be refused. */
    return numeric_larger(allowed_A, numeric_larger(planned_A, asked_A));
}

void bms_follow_growth(bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    const rcbf_decision_t *decision = &bms->decision;
    const float growth_A = calibration->current_growth_A;
    const float most_A = numeric_smaller(growth_A, -MOST_RISE * calibration->reference_current_A);
    if (!is_charging(bms) || bms->monitor.stop) {
        bms->growth_A = growth_A;
        rcbf_steadier_reset(&bms->steadier);
    } else if (decision->feasible && (decision->active != RCBF_NONE)) {
        bms->limit = decision->active;
        bms->growth_A = LEAST_GROWTH * growth_A;
    } else if (decision->feasible && (decision->current_A > bms->command_A - bms->growth_A)) {
        bms->growth_A = most_A;
    } else if (decision->feasible && (bms->growth_A < most_A)) {
        bms->decision.active = bms->limit;
        bms->state = BMS_DERATED;
        bms->growth_A = numeric_smaller(bms->growth_A + GROWTH_RISE * growth_A, most_A);
    }
}
