/* Any number through any signal of the database: in range, on its step, and back. */
#include "proof.h"

#include <math.h>

#include "can_catalog.h"
#include "codec.h"

int main(void)
{
    ANY(uint32_t, index);
    ANY(uint32_t, any_raw);
    ANY(float, value);
    ANY(bool, towards_zero);
    GRANTED(index < CAN_SIGNAL_COUNT);
    const codec_signal_t *signal = &CAN_SIGNALS[index];
    const uint32_t raw =
        codec_encode(signal, value, towards_zero ? CODEC_TOWARDS_ZERO : CODEC_NEAREST);
    HOLDS(raw <= signal->raw_max + 2u, "a raw value fits");
    if (value != value) {
        HOLDS(raw == signal->raw_max + 2u, "what is no number is not available");
    }
    if (raw != signal->raw_max + 2u) {
        HOLDS(raw <= signal->raw_max, "and nothing else is");
    }
    GRANTED(any_raw <= 0xFFFFFFu);
    const float back = codec_decode(signal, any_raw);
    HOLDS((back == back) == (any_raw <= signal->raw_max), "a number where there is one");
    return 0;
}
