/* Reads rows of 10 numbers: the estimator's four inputs and the decision's six. Prints a line each with
 * estimate, domain flag, current, feasible flag, active constraint and interval, exactly. */
#include <stdio.h>

#include "bms.h"

#define INPUTS (KAN_MEASURED_INPUTS + 6)

int main(void)
{
    const bms_calibration_t *cell = &BMS_DEFAULT_CALIBRATION;
    float in[INPUTS];
    if (!calibration_is_valid(cell)) {
        return 1;
    }
    for (;;) {
        for (int i = 0; i < INPUTS; i++) {
            if (scanf("%f", &in[i]) != 1) {
                return (i == 0) ? 0 : 1;
            }
        }
        const kan_estimate_t estimate = kan_evaluate(&cell->kan, in);
        const rcbf_input_t input = {
            .soc = in[4],
            .core_temperature_K = { .high_K = in[5] },
            .surface_temperature_K = { .high_K = in[6] },
            .coolant_temperature_K = { .high_K = in[7] },
            .cooling_power_W = in[8],
            .reference_current_A = in[9],
        };
        const rcbf_decision_t decision = rcbf_solve(&cell->rcbf, &input);
        printf("%a %d %a %d %d %a %a\n", (double)estimate.core_temperature_K, estimate.in_domain,
               (double)decision.current_A, decision.feasible, (int)decision.active,
               (double)decision.lower_A, (double)decision.upper_A);
    }
}
