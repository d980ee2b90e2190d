#include <math.h>

#include "fuzz.h"

void fuzz_deliver(fuzzer_t *fuzzer, const can_frame_t *frame)
{
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        const codec_message_t *message = &CAN_RECEIVED[i];
        if ((frame->id == message->id) && (frame->length == message->length) &&
            (frame->data[0] == e2e_crc(frame->data, frame->length, message->data_ids))) {
            fuzzer->came_intact[i] = true;
        }
    }
    bms_receive(&fuzzer->bms, frame);
    fuzzer->statistics.frames++;
}

void fuzz_deliver_damaged(fuzzer_t *fuzzer, uint32_t message, can_frame_t frame)
{
    random_t *random = &fuzzer->random;
    const mutation_t mutation = (mutation_t)random_below(random, MUTATION_COUNT);
    const can_frame_t old = fuzzer->last_sent[message];
    fuzzer->statistics.mutations[mutation]++;
    switch (mutation) {
    case MUTATION_DROPPED:
        return;
    case MUTATION_REPEATED:
        fuzz_deliver(fuzzer, &frame);
        break;
    case MUTATION_OLD:
        frame = old;
        break;
    case MUTATION_SWAPPED:
        fuzz_deliver(fuzzer, &frame);
        frame = old;
        break;
    case MUTATION_BIT:
        frame.data[random_below(random, 8u)] ^= (uint8_t)(1u << random_below(random, 8u));
        break;
    case MUTATION_BYTE:
        frame.data[random_below(random, 8u)] = (uint8_t)random_bits(random);
        break;
    case MUTATION_LENGTH:
        frame.length = (uint8_t)random_below(random, random_chance(random, 128u) ? 256u : 9u);
        break;
    case MUTATION_ID:
        frame.id ^= 1u << random_below(random, 32u);
        break;
    case MUTATION_CONTENT: {
        const uint8_t counter = frame.data[1];
        frame.data[2u + random_below(random, 6u)] = (uint8_t)random_bits(random);
        session_protect(&frame, message, counter);
        break;
    }
    case MUTATION_COUNTER:
        session_protect(&frame, message, (uint8_t)random_bits(random));
        break;
    default:
        fuzzer->session.counters[message] = (uint8_t)random_bits(random);
        break;
    }
    fuzz_deliver(fuzzer, &frame);
}

void fuzz_deliver_foreign(fuzzer_t *fuzzer)
{
    random_t *random = &fuzzer->random;
    for (uint32_t left = 1u + random_below(random, 8u); left > 0u; left--) {
        can_frame_t frame = { .id = random_bits(random) >> random_below(random, 32u) };
        frame.length = (uint8_t)random_below(random, random_chance(random, 64u) ? 256u : 9u);
        for (uint32_t i = 0u; i < 8u; i++) {
            frame.data[i] = (uint8_t)random_bits(random);
        }
        if (random_chance(random, 256u)) {
            const uint32_t message = random_below(random, CAN_RECEIVED_COUNT);
            frame.id = CAN_RECEIVED[message].id;
            if (random_chance(random, 512u)) {
                frame.length = CAN_RECEIVED[message].length;
                session_protect(&frame, message, frame.data[1]);
            }
        }
        fuzzer->statistics.foreign++;
        fuzz_deliver(fuzzer, &frame);
    }
}

void fuzz_damage_values(fuzzer_t *fuzzer, float values[VALUE_COUNT])
{
    static const float SIZE[VALUE_COUNT] = { 10.0f, 0.6f, 20.0f, 20.0f, 3.0f,
                                             30.0f, 0.5f, 3.0f,  3.0f,  7200.0f };
    random_t *random = &fuzzer->random;
    if (fuzzer->wrong_periods == 0u) {
        if (!random_chance(random, fuzzer->value_share)) {
            return;
        }
        fuzzer->wrong_value = (session_value_t)random_below(random, VALUE_COUNT);
        fuzzer->wrong_kind = random_below(random, 4u);
        fuzzer->wrong_periods = 1u + random_below(random, random_chance(random, 512u) ? 4u : 64u);
        fuzzer->wrong_by = SIZE[fuzzer->wrong_value] * random_between(random, -1.0f, 1.0f);
        if (fuzzer->wrong_kind == 2u) {
            fuzzer->wrong_by = values[fuzzer->wrong_value];
        }
        fuzzer->statistics.values++;
    }
    fuzzer->wrong_periods--;
    float *value = &values[fuzzer->wrong_value];
    switch (fuzzer->wrong_kind) {
    case 0u:
        *value += fuzzer->wrong_by;
        break;
    case 1u:
        *value += fuzzer->wrong_by / (float)(1u + fuzzer->wrong_periods);
        break;
    case 2u:
        *value = fuzzer->wrong_by;
        break;
    default:
        *value = NAN;
        break;
    }
}
