#include "request.h"

static bool mode_is_known(const codec_measurement_t *asked)
{
    return (asked->mode == MODE_FASTEST) || (asked->mode == MODE_FIXED) ||
           ((asked->mode == MODE_BY_TIME) && (asked->time_to_full_s >= 0.0f));
}

bool request_is_valid(const codec_measurement_t *asked, bool has_mode, float max_soc)
{
    const bool start_is_known = (asked->plug_in_soc >= 0.0f) && (asked->plug_in_soc <= max_soc);
    return (asked->request == REQUEST_OFF) ||
           ((asked->request == REQUEST_CHARGE) && (asked->reference_current_A <= 0.0f) &&
            start_is_known && (!has_mode || mode_is_known(asked)));
}
