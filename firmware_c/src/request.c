#include "request.h"

static bool mode_is_known(uint8_t mode)
{
    return (mode == MODE_FASTEST) || (mode == MODE_FIXED);
}

bool request_is_valid(const codec_measurement_t *asked, bool has_mode, float max_soc)
{
    const bool start_is_known = (asked->plug_in_soc >= 0.0f) && (asked->plug_in_soc <= max_soc);
    return (asked->request == REQUEST_OFF) ||
           ((asked->request == REQUEST_CHARGE) && (asked->reference_current_A <= 0.0f) &&
            start_is_known && (!has_mode || mode_is_known(asked->mode)));
}
