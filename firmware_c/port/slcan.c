#include "slcan.h"

#define IDENTIFIER_DIGITS 3u
#define FRAME_HEAD 5u /* t, identifier, length */
#define HIGHEST_IDENTIFIER 0x7FFu /* of 11 bits; three digits hold 12 */
#define MAX_DATA_LENGTH 8u

/* Value of a hexadecimal digit, or more than 15. */
static uint32_t digit(uint8_t character)
{
    if ((character >= (uint8_t)'0') && (character <= (uint8_t)'9')) {
        return (uint32_t)character - (uint32_t)'0';
    }
    const uint32_t letter = (uint32_t)character | 0x20u;
    return ((letter >= (uint32_t)'a') && (letter <= (uint32_t)'f'))
               ? (letter - (uint32_t)'a' + 10u)
               : 16u;
}

static bool parse_number(const uint8_t *text, uint32_t digits, uint32_t *number)
{
    *number = 0u;
    for (uint32_t i = 0u; i < digits; i++) {
        const uint32_t value = digit(text[i]);
        if (value > 15u) {
            return false;
        }
        *number = (*number << 4u) | value;
    }
    return true;
}

static bool parse_frame(const slcan_t *slcan, can_frame_t *frame)
{
    uint32_t length;
    if (!parse_number(&slcan->line[1], IDENTIFIER_DIGITS, &frame->id) ||
        (frame->id > HIGHEST_IDENTIFIER) ||
        !parse_number(&slcan->line[FRAME_HEAD - 1u], 1u, &length) || (length > MAX_DATA_LENGTH) ||
        (slcan->length != FRAME_HEAD + 2u * length)) {
        return false;
    }
    frame->length = (uint8_t)length;
    for (uint32_t i = 0u; i < length; i++) {
        uint32_t byte;
        if (!parse_number(&slcan->line[FRAME_HEAD + 2u * i], 2u, &byte)) {
            return false;
        }
        frame->data[i] = (uint8_t)byte;
    }
    return true;
}

static slcan_event_t take_line(slcan_t *slcan, can_frame_t *frame)
{
    if (slcan->length > SLCAN_LONGEST_LINE) {
        return SLCAN_REFUSED;
    }
    switch (slcan->line[0]) {
    case 't':
        return (slcan->is_open && parse_frame(slcan, frame)) ? SLCAN_FRAME : SLCAN_REFUSED;
    case 'T':
    case 'r':
    case 'R':
        return SLCAN_NOTHING;
    case 'O':
    case 'L':
        slcan->is_open = true;
        return SLCAN_ACCEPTED;
    case 'C':
        slcan->is_open = false;
        return SLCAN_ACCEPTED;
    case 'S':
    case 's':
    case 'Z':
        return SLCAN_ACCEPTED;
    case 'F':
        return SLCAN_ASKED_FLAGS;
    case 'V':
        return SLCAN_ASKED_VERSION;
    case 'N':
        return SLCAN_ASKED_SERIAL_NUMBER;
    default:
        return SLCAN_REFUSED;
    }
}

slcan_event_t slcan_take(slcan_t *slcan, uint8_t byte, can_frame_t *frame)
{
    slcan_event_t event = SLCAN_NOTHING;
    if (byte == (uint8_t)SLCAN_OK) {
        if (slcan->length > 0u) {
            event = take_line(slcan, frame);
        }
        slcan->length = 0u;
    } else if (slcan->length < SLCAN_LONGEST_LINE) {
        slcan->line[slcan->length] = byte;
        slcan->length++;
    } else {
        slcan->length = SLCAN_LONGEST_LINE + 1u;
    }
    return event;
}

void slcan_print_byte(uint8_t byte, uint8_t text[2])
{
    static const char DIGITS[] = "0123456789ABCDEF";
    text[0] = (uint8_t)DIGITS[byte >> 4u];
    text[1] = (uint8_t)DIGITS[byte & 15u];
}

uint32_t slcan_print(const can_frame_t *frame, uint8_t text[SLCAN_LONGEST_FRAME])
{
    uint32_t length = FRAME_HEAD;
    slcan_print_byte((uint8_t)(frame->id >> 4u), &text[1]);
    slcan_print_byte((uint8_t)((frame->id << 4u) | frame->length), &text[IDENTIFIER_DIGITS]);
    text[0] = (uint8_t)'t';
    for (uint32_t i = 0u; i < frame->length; i++) {
        slcan_print_byte(frame->data[i], &text[length]);
        length += 2u;
    }
    text[length] = (uint8_t)SLCAN_OK;
    return length + 1u;
}
