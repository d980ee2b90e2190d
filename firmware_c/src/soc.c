#include "soc.h"

void soc_add(soc_counter_t *counter, float change)
{
    const float whole = change - counter->lost;
    const float sum = counter->soc + whole;
    counter->lost = (sum - counter->soc) - whole;
    counter->soc = sum;
}

void soc_set(soc_t *state, float soc)
{
    *state = (soc_t){ .measured = { soc, 0.0f }, .commanded = { soc, 0.0f }, .soc = soc };
}

void soc_count(soc_t *state, float measured_A, float commanded_A, float period_s,
               float capacity_As)
{
    soc_add(&state->measured, -measured_A * period_s / capacity_As);
    soc_add(&state->commanded, -commanded_A * period_s / capacity_As);
    state->soc = (state->measured.soc < state->commanded.soc) ? state->commanded.soc
                                                               : state->measured.soc;
}
