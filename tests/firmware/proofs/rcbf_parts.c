/* The decision by parts: whatever numbers come, no NaN among them admits a stronger current. */
#include "proof.h"

#include "rcbf.c"

static bool is_below(float a, float b)
{
    return a < b;
}

int main(void)
{
    ANY(interval_t, interval);
    ANY(float, end_A);
    ANY(rcbf_active_t, name);
    ANY(rcbf_input_t, input);
    ANY(float, kept);
    ANY(concave_t, f);
    ANY(float, margin);
    GRANTED((interval.lower_A >= -LARGEST_INPUT) && (interval.lower_A <= FLT_MAX));
    const interval_t before = interval;

    raise_lower(&interval, end_A, name);
    HOLDS(interval.lower_A == interval.lower_A, "the strongest current stays a number");
    HOLDS(!is_below(interval.lower_A, before.lower_A), "and gets no stronger");
    HOLDS((end_A == end_A) || (interval.lower_A == FLT_MAX), "an end that is no number leaves none");
    HOLDS(!(end_A > interval.lower_A) || (end_A > FLT_MAX), "nothing beyond the end is left");

    if (is_physical(&input)) {
        HOLDS((input.soc >= LOWEST_SOC) && (input.soc <= HIGHEST_SOC), "charge is in its range");
        HOLDS((input.core_temperature_K.high_K >= COLDEST_K) &&
                  (input.core_temperature_K.high_K <= HOTTEST_K),
              "so is the core");
        HOLDS((input.surface_temperature_K.high_K >= COLDEST_K) &&
                  (input.surface_temperature_K.high_K <= HOTTEST_K),
              "the surface");
        HOLDS((input.coolant_temperature_K.high_K >= COLDEST_K) &&
                  (input.coolant_temperature_K.high_K <= HOTTEST_K),
              "and the coolant");
        HOLDS((input.reference_current_A <= 0.0f) &&
                  (input.reference_current_A >= -LARGEST_INPUT),
              "and nobody asks for a discharge");
    } else {
        rcbf_constants_t constants;
        rcbf_steadier_t steadier;
        const rcbf_decision_t decision =
            rcbf_solve_steadily(&constants, &input, end_A, &steadier);
        HOLDS(!decision.feasible && (decision.current_A == 0.0f), "what is not physical gives 0 A");
    }

    const float constant = f.constant;
    steady(&kept, &f, margin);
    HOLDS((constant != constant) || !(f.constant > constant), "steadied is no more than was read");
    HOLDS((constant != constant) || (f.constant == f.constant), "and a number where that was one");
    return 0;
}
