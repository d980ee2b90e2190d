#include "wire.h"

#include <math.h>

static uint64_t raw_of(const wire_signal_t *signal, double value)
{
    if (isnan(value)) {
        return (UINT64_C(1) << signal->length) - 1u;
    }
    const double steps = value / signal->scale - signal->offset_steps;
    return (uint64_t)rint(fmin(fmax(steps, signal->lowest), signal->highest));
}

static void encode(const wire_message_t *message, const double *values, uint8_t counter,
                   can_frame_t *frame)
{
    uint64_t bits = 0u;
    for (uint32_t i = 0u; i < message->signals; i++) {
        bits |= raw_of(&message->signal[i], values[i]) << message->signal[i].start;
    }
    frame->id = message->id;
    frame->length = message->length;
    for (uint32_t i = 0u; i < sizeof frame->data; i++) {
        frame->data[i] = (uint8_t)(bits >> (8u * i));
    }
    if (message->is_protected != 0u) {
        e2e_protect(frame->data, frame->length, message->data_ids, counter);
    }
}

void wire_send(wire_t *wire, uint32_t messages, const double *values, can_frame_t *frames)
{
    for (uint32_t i = 0u; i < messages; i++) {
        const wire_message_t *message = &wire->message[i];
        encode(message, values, wire->counter[i], &frames[i]);
        wire->counter[i] = (uint8_t)((wire->counter[i] + 1u) % E2E_COUNTERS);
        values += message->signals;
    }
}

bool wire_is_intact(const wire_message_t *message, const uint8_t *data, uint32_t length)
{
    return (length == message->length) &&
           ((message->is_protected == 0u) ||
            (data[0] == e2e_crc(data, message->length, message->data_ids)));
}

void wire_decode(const wire_message_t *message, const uint8_t *data, double *values)
{
    uint64_t bits = 0u;
    for (uint32_t i = 0u; i < message->length; i++) {
        bits |= (uint64_t)data[i] << (8u * i);
    }
    for (uint32_t i = 0u; i < message->signals; i++) {
        const wire_signal_t *signal = &message->signal[i];
        const double raw =
            (double)((bits >> signal->start) & ((UINT64_C(1) << signal->length) - 1u));
        const bool carries = (raw >= signal->lowest) && (raw <= signal->highest);
        values[i] = carries ? (raw + signal->offset_steps) * signal->scale : (double)NAN;
    }
}

/* Whether a frame is none of its message, or the one before once more; else it counts. */
static bool is_refused(wire_t *wire, uint32_t row, const can_frame_t *frame)
{
    const wire_message_t *message = &wire->message[row];
    if (!wire_is_intact(message, frame->data, frame->length)) {
        return true;
    }
    if (message->is_protected == 0u) {
        return false;
    }
    const uint8_t counter = frame->data[1] % E2E_COUNTERS;
    const bool is_repeated = wire->has_counter[row] && (counter == wire->counter[row]);
    wire->counter[row] = counter;
    wire->has_counter[row] = true;
    return is_repeated;
}

void wire_receive(wire_t *wire, const can_frame_t *frames, uint32_t count, double *values)
{
    for (uint32_t n = 0u; n < count; n++) {
        double *place = values;
        for (uint32_t row = 0u; row < wire->messages; row++) {
            const wire_message_t *message = &wire->message[row];
            if (message->id == frames[n].id) {
                if (!is_refused(wire, row, &frames[n])) {
                    wire_decode(message, frames[n].data, place);
                }
                break;
            }
            place += message->signals;
        }
    }
}
