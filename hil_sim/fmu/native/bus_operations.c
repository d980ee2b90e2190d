#include "bus_operations.h"

#include <string.h>

#define FRAME_ARGUMENT_BYTES 8u /* identifier, two flags, length of the data */
#define CAN_BAUDRATE 0x01u
#define ARBITRATION_LOST_BEHAVIOUR 0x04u
#define BUFFER_AND_RETRANSMIT 0x01u

static uint32_t number_at(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8u) | ((uint32_t)bytes[2] << 16u) |
           ((uint32_t)bytes[3] << 24u);
}

static void put(uint8_t *place, uint32_t number, uint32_t bytes)
{
    for (uint32_t i = 0u; i < bytes; i++) {
        place[i] = (uint8_t)(number >> (8u * i));
    }
}

bool bus_next(const uint8_t **place, const uint8_t *end, bus_operation_t *operation)
{
    const uint32_t left = (uint32_t)(end - *place);
    if (left == 0u) {
        return false;
    }
    *operation = (bus_operation_t){ 0u, *place, left, true };
    if (left >= BUS_HEADER_BYTES) {
        const uint32_t length = number_at(*place + 4);
        operation->code = number_at(*place);
        if ((length >= BUS_HEADER_BYTES) && (length <= left)) {
            operation->length = length;
            operation->is_damaged = false;
        }
    }
    *place += operation->length;
    return true;
}

uint32_t bus_number(const bus_operation_t *operation, uint32_t offset)
{
    return number_at(&operation->bytes[BUS_HEADER_BYTES + offset]);
}

uint8_t bus_byte(const bus_operation_t *operation, uint32_t offset)
{
    return operation->bytes[BUS_HEADER_BYTES + offset];
}

bus_reading_t bus_read_frame(const bus_operation_t *operation, can_frame_t *frame)
{
    const uint32_t without_data = BUS_HEADER_BYTES + FRAME_ARGUMENT_BYTES;
    if (operation->length < without_data) {
        return BUS_NO_FRAME;
    }
    const uint8_t is_extended = bus_byte(operation, 4u);
    const uint8_t is_remote = bus_byte(operation, 5u);
    const uint32_t length = (uint32_t)bus_byte(operation, 6u) | ((uint32_t)bus_byte(operation, 7u) << 8u);
    const uint32_t data_bytes = operation->length - without_data;
    frame->id = bus_number(operation, 0u);
    if ((is_extended > 1u) || (is_remote > 1u) || (length > sizeof frame->data) ||
        (frame->id > ((is_extended != 0u) ? 0x1FFFFFFFu : 0x7FFu)) ||
        ((data_bytes != length) && ((is_remote == 0u) || (data_bytes != 0u)))) {
        return BUS_NO_FRAME;
    }
    if ((is_extended != 0u) || (is_remote != 0u)) {
        return BUS_OTHER_FRAME;
    }
    frame->length = (uint8_t)length;
    memset(frame->data, 0, sizeof frame->data);
    memcpy(frame->data, &operation->bytes[without_data], length);
    return BUS_FRAME;
}

/* Room for an operation with its header written; NULL where there is none. */
static uint8_t *append(bus_outgoing_t *outgoing, uint32_t code, uint32_t argument_bytes)
{
    const uint32_t length = BUS_HEADER_BYTES + argument_bytes;
    if (length > BUS_OUTGOING_BYTES - outgoing->length) {
        return NULL;
    }
    uint8_t *place = &outgoing->bytes[outgoing->length];
    put(place, code, 4u);
    put(place + 4, length, 4u);
    outgoing->length += length;
    return place + BUS_HEADER_BYTES;
}

bool bus_transmit(bus_outgoing_t *outgoing, const can_frame_t *frame)
{
    uint8_t *place = append(outgoing, BUS_CAN_TRANSMIT, FRAME_ARGUMENT_BYTES + frame->length);
    if (place == NULL) {
        return false;
    }
    put(place, frame->id, 4u);
    put(place + 4, 0u, 2u); /* neither extended nor remote */
    put(place + 6, frame->length, 2u);
    memcpy(place + FRAME_ARGUMENT_BYTES, frame->data, frame->length);
    return true;
}

bool bus_configure_baudrate(bus_outgoing_t *outgoing, uint32_t baudrate)
{
    uint8_t *place = append(outgoing, BUS_CONFIGURATION, 5u);
    if (place == NULL) {
        return false;
    }
    place[0] = CAN_BAUDRATE;
    put(place + 1, baudrate, 4u);
    return true;
}

bool bus_configure_buffering(bus_outgoing_t *outgoing)
{
    uint8_t *place = append(outgoing, BUS_CONFIGURATION, 2u);
    if (place == NULL) {
        return false;
    }
    place[0] = ARBITRATION_LOST_BEHAVIOUR;
    place[1] = BUFFER_AND_RETRANSMIT;
    return true;
}

bool bus_tell_status(bus_outgoing_t *outgoing, uint8_t status)
{
    uint8_t *place = append(outgoing, BUS_STATUS, 1u);
    if (place == NULL) {
        return false;
    }
    place[0] = status;
    return true;
}

bool bus_tell_format_error(bus_outgoing_t *outgoing, const bus_operation_t *wrong)
{
    const uint32_t told = (wrong->length < UINT16_MAX) ? wrong->length : UINT16_MAX;
    uint8_t *place = append(outgoing, BUS_FORMAT_ERROR, 2u + told);
    if (place == NULL) {
        return false;
    }
    put(place, told, 2u);
    memcpy(place + 2, wrong->bytes, told);
    return true;
}
