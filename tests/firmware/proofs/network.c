/* Any frame in any state of the network: within memory, foreign ones ignored, counts bounded. */
#include "proof.h"

#include "can_catalog.h"
#include "network.h"

int main(void)
{
    ANY(network_t, network);
    ANY(can_frame_t, frame);
    ANY(codec_measurement_t, taken);
    ANY(uint32_t, other);
    GRANTED((frame.length <= 8u) && (other < CAN_RECEIVED_COUNT));
    const network_t before = network;
    const codec_measurement_t had = taken;
    network_receive(&network, &frame, &taken);
    HOLDS(network.measured_periods >= before.measured_periods, "the count does not wrap");
    if (frame.id != CAN_RECEIVED[other].id) {
        HOLDS(network.receivers[other].is_good == before.receivers[other].is_good,
              "a frame makes no other message good");
        HOLDS(network.receivers[other].counter == before.receivers[other].counter,
              "nor moves its counter");
    } else if (!network.receivers[other].is_good) {
        HOLDS((taken.request == had.request) && (taken.mode == had.mode),
              "what is refused is not taken");
    }
    return 0;
}
