/* Any frame in any state of a receiver: what is not intact and in sequence is not good. */
#include "proof.h"

#include "e2e.h"

int main(void)
{
    ANY(e2e_receiver_t, receiver);
    uint8_t data[8];
    uint8_t ids[E2E_COUNTERS];
    ANY(uint8_t, length);
    ANY(uint8_t, expected);
    ANY(uint8_t, max_delta);
    GRANTED((length <= 8u) && (max_delta < E2E_COUNTERS));
    const e2e_receiver_t before = receiver;
    const e2e_status_t status =
        e2e_check(&receiver, data, length, expected, ids, max_delta);
    const uint32_t steps = ((uint32_t)receiver.counter + 16u - (before.counter & 15u)) & 15u;
    if (status == E2E_OK) {
        HOLDS(length == expected && length >= 2u, "a good frame has its length");
        HOLDS(data[0] == e2e_crc(data, length, ids), "a good frame has its CRC");
        HOLDS(receiver.counter == (data[1] & 15u), "its counter is kept");
        HOLDS(receiver.is_good && !receiver.has_refused, "the period is good");
        HOLDS(!before.has_started || steps != 0u,
              "no counter is good twice");
        HOLDS(!before.has_started || before.has_refused ||
                  (steps <= max_delta),
              "nor after more than may be lost, but for a sender that goes on anew");
    } else {
        HOLDS(receiver.is_disturbed, "any other disturbs");
        HOLDS(receiver.is_good == before.is_good, "and makes no period good");
        HOLDS(receiver.counter == before.counter, "nor moves the counter");
    }
    HOLDS(receiver.counts.lost >= before.counts.lost, "counts do not wrap");
    HOLDS(receiver.counts.wrong_crc >= before.counts.wrong_crc, "counts do not wrap");
    HOLDS(receiver.counts.wrong_length >= before.counts.wrong_length, "counts do not wrap");
    HOLDS(receiver.counts.repeated >= before.counts.repeated, "counts do not wrap");
    HOLDS(receiver.counts.reordered >= before.counts.reordered, "counts do not wrap");
    return 0;
}
