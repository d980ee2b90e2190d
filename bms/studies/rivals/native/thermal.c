#include "thermal.h"

thermal_state_t thermal_rest(const float *inputs)
{
    const thermal_state_t state = { inputs[INPUT_SURFACE], inputs[INPUT_SURFACE],
                                    inputs[INPUT_CURRENT], inputs[INPUT_COOLANT] };
    return state;
}

float thermal_heat_W(const thermal_t *cell, const thermal_state_t *state, float resistance_ohm)
{
    return (resistance_ohm * state->current_A -
            cell->entropic_coefficient_V_per_K * state->core_K) *
           state->current_A;
}

void thermal_advance(const thermal_t *cell, thermal_state_t *state, float heat_W,
                     const float *inputs)
{
    const float coolant_K = 0.5f * (state->coolant_K + inputs[INPUT_COOLANT]);
    const float core = state->core_K - coolant_K;
    const float surface = state->surface_K - coolant_K;
    state->core_K = coolant_K + cell->transition[0][0] * core +
                    cell->transition[0][1] * surface + cell->heat_gain_K_per_W[0] * heat_W;
    state->surface_K = coolant_K + cell->transition[1][0] * core +
                       cell->transition[1][1] * surface + cell->heat_gain_K_per_W[1] * heat_W;
    state->current_A = inputs[INPUT_CURRENT];
    state->coolant_K = inputs[INPUT_COOLANT];
}
