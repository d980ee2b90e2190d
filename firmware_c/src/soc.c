#include "soc.h"

static void count(soc_counter_t *counter, float current_A, float period_s, float capacity_As)
{
    const float change = -current_A * period_s / capacity_As - counter->lost;
    const float sum = counter->soc + change;
    counter->lost = (sum - counter->soc) - change;
    counter->soc = sum;
}

void soc_set(soc_t *state, float soc)
{
    *state = (soc_t){ .measured = { soc, 0.0f }, .commanded = { soc, 0.0f }, .soc = soc };
}

void soc_count(soc_t *state, float measured_A, float commanded_A, float period_s,
               float capacity_As)
{
    count(&state->measured, measured_A, period_s, capacity_As);
    count(&state->commanded, commanded_A, period_s, capacity_As);
    state->soc = (state->measured.soc < state->commanded.soc) ? state->commanded.soc
                                                               : state->measured.soc;
}
