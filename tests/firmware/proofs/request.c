/* Any request: a charge that is admitted has a known start, a charging reference and a known mode. */
#include "proof.h"

#include "request.h"

int main(void)
{
    ANY(codec_measurement_t, asked);
    ANY(bool, has_mode);
    ANY(float, max_soc);
    const bool is_valid = request_is_valid(&asked, has_mode, max_soc);
    if (is_valid && (asked.request != REQUEST_OFF)) {
        HOLDS(asked.request == REQUEST_CHARGE, "nothing else is asked for");
        HOLDS(asked.reference_current_A <= 0.0f, "no number and no discharge is none");
        HOLDS((asked.plug_in_soc >= 0.0f) && (asked.plug_in_soc <= max_soc), "a known start");
        HOLDS(!has_mode || (asked.mode <= MODE_FIXED), "a mode that there is");
    }
    HOLDS((asked.request != REQUEST_OFF) || is_valid, "off can always be asked for");
    return 0;
}
