#include "soc.h"

void soc_set(soc_t *counter, float soc)
{
    counter->soc = soc;
    counter->lost = 0.0f;
}

void soc_count(soc_t *counter, float current_A, float period_s, float capacity_As)
{
    const float change = -current_A * period_s / capacity_As - counter->lost;
    const float sum = counter->soc + change;
    counter->lost = (sum - counter->soc) - change;
    counter->soc = sum;
}
