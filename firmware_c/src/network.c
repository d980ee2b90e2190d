#include "network.h"

#include "can_catalog.h"

typedef char received_messages_agree[(NETWORK_MESSAGES == CAN_RECEIVED_COUNT) ? 1 : -1];

/* A frame stands for the ones lost before it too, but for those of a sender that starts anew. */
static void count_periods(network_t *network, uint8_t last, uint8_t now)
{
    const uint8_t steps = (uint8_t)((now - last) & (E2E_COUNTERS - 1u));
    const uint8_t most = CAN_RECEIVED[CAN_RECEIVED_CELL_ELECTRICAL].policy.max_delta_counter;
    const uint8_t periods = (steps <= most) ? steps : 1u;
    if (network->measured_periods <= UINT8_MAX - periods) {
        network->measured_periods = (uint8_t)(network->measured_periods + periods);
    }
}

void network_receive(network_t *network, const can_frame_t *frame,
                     codec_measurement_t *measurement)
{
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        const codec_message_t *message = &CAN_RECEIVED[i];
        if (frame->id != message->id) {
            continue;
        }
        e2e_receiver_t *receiver = &network->receivers[i];
        const uint8_t counter = receiver->counter;
        if (e2e_check(receiver, frame->data, frame->length, message->length, message->data_ids,
                      message->policy.max_delta_counter) == E2E_OK) {
            codec_read(i, frame->data, measurement);
            if (i == CAN_RECEIVED_CELL_ELECTRICAL) {
                count_periods(network, counter, receiver->counter);
            }
        }
        return; /* no two messages have one identifier */
    }
}

void network_step(network_t *network)
{
    network->is_disturbed = false;
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        const e2e_verdict_t verdict =
            e2e_supervise(&network->receivers[i], &CAN_RECEIVED[i].policy);
        network->is_usable[i] = verdict.is_usable;
        network->is_disturbed = network->is_disturbed || verdict.is_disturbed;
    }
}

bool network_is_valid(const network_t *network)
{
    bool is_valid = true;
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        is_valid = is_valid && (CAN_RECEIVED[i].is_optional ||
                                (network->receivers[i].state == E2E_VALID));
    }
    return is_valid;
}
