#include "pace.h"

/* Frames that may be lost before their silence is a fault; what was lost is counted afterwards. */
#define MOST_OWED_PERIODS 3

void pace_step(pace_t *pace, uint8_t measured_periods)
{
    int32_t ahead = pace->ahead + ((int32_t)measured_periods - 1) * PACE_FORGOTTEN_PERIODS;
    if (ahead > 0) {
        ahead--;
    }
    if (ahead < -MOST_OWED_PERIODS * PACE_FORGOTTEN_PERIODS) {
        ahead = -MOST_OWED_PERIODS * PACE_FORGOTTEN_PERIODS;
    }
    pace->ahead = ahead;
}

bool pace_is_lost(const pace_t *pace)
{
    return pace->ahead > PACE_ALLOWED_PERIODS * PACE_FORGOTTEN_PERIODS;
}
