/* Any count of measurements in any state that there can be: bounded, and lost only when far ahead. */
#include "proof.h"

#include "pace.h"

int main(void)
{
    ANY(pace_t, pace);
    ANY(uint8_t, measured);
    const int32_t most = 255 * 20 * PACE_FORGOTTEN_PERIODS;
    GRANTED((pace.ahead >= -3 * PACE_FORGOTTEN_PERIODS) && (pace.ahead <= most));
    const pace_t before = pace;
    pace_step(&pace, measured);
    HOLDS(pace.ahead >= -3 * PACE_FORGOTTEN_PERIODS, "no more is owed than may be");
    HOLDS((measured > 1u) || (pace.ahead <= before.ahead), "one a period moves nothing ahead");
    HOLDS((measured == 0u) || (pace.ahead >= before.ahead - 1), "nor does it fall by more than is forgotten");
    HOLDS(pace_is_lost(&pace) == (pace.ahead > PACE_ALLOWED_PERIODS * PACE_FORGOTTEN_PERIODS),
          "lost is what is further ahead than allowed");
    return 0;
}
