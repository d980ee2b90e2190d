#include "pack_codec.h"

#include <math.h>

uint64_t pack_bits(const can_frame_t *frame)
{
    uint64_t bits = 0u;
    for (uint32_t i = 0u; (i < frame->length) && (i < sizeof frame->data); i++) {
        bits |= (uint64_t)frame->data[i] << (8u * i);
    }
    return bits;
}

void pack_fill(can_frame_t *frame, const codec_message_t *message, uint64_t bits)
{
    frame->id = message->id;
    frame->length = message->length;
    for (uint32_t i = 0u; i < sizeof frame->data; i++) {
        frame->data[i] = (uint8_t)(bits >> (8u * i));
    }
}

static uint32_t field(uint64_t bits, uint32_t start, uint32_t length)
{
    return (uint32_t)((bits >> start) & ((UINT64_C(1) << length) - 1u));
}

uint32_t pack_code(uint64_t bits, uint32_t signal)
{
    return field(bits, PACK_SIGNALS[signal].start, PACK_SIGNALS[signal].length);
}

float pack_value(uint64_t bits, uint32_t signal)
{
    return codec_decode(&PACK_SIGNALS[signal].scaling, pack_code(bits, signal));
}

uint64_t pack_with_code(uint32_t signal, uint32_t code)
{
    const pack_signal_t *place = &PACK_SIGNALS[signal];
    /* A code that its field cannot hold becomes all ones, which says "not available". */
    const uint32_t most = place->scaling.raw_max;
    return (uint64_t)((code < most) ? code : most) << place->start;
}

uint64_t pack_with_value(uint32_t signal, float value, codec_rounding_t rounding)
{
    const pack_signal_t *place = &PACK_SIGNALS[signal];
    return (uint64_t)codec_encode(&place->scaling, value, rounding) << place->start;
}

/* The generator has it so: identifiers of a group follow each other, and values are whole bytes. */
#define PAGE_BYTE (PACK_PAGE_START / 8)
#define PAGE_SHIFT 4u
#define FIRST_VALUE_BYTE (PACK_VALUE_START / 8)
typedef char page_is_a_half_byte[(PACK_PAGE_START % 8 == 4) ? 1 : -1];
typedef char values_are_two_bytes[((PACK_VALUE_LENGTH == 16) && (PACK_VALUE_START % 8 == 0) &&
                                   (PACK_VALUE_START == 8 * (PAGE_BYTE + 1)))
                                      ? 1
                                      : -1];

bool pack_page_of(uint32_t group, const can_frame_t *frame, uint32_t *page)
{
    const uint32_t message = frame->id - PACK_GROUPS[group].message[0].id;
    if (message >= PACK_GROUP_MESSAGES) {
        return false;
    }
    *page = message * PACK_PAGES_A_MESSAGE + (frame->data[PAGE_BYTE] >> PAGE_SHIFT);
    return true;
}

const codec_message_t *pack_page_message(uint32_t group, uint32_t page)
{
    return &PACK_GROUPS[group].message[page / PACK_PAGES_A_MESSAGE];
}

uint32_t pack_pages(uint32_t cells)
{
    return (cells + PACK_CELLS_A_PAGE - 1u) / PACK_CELLS_A_PAGE;
}

float pack_page_value(uint32_t group, const can_frame_t *frame, uint32_t place)
{
    const uint8_t *bytes = &frame->data[FIRST_VALUE_BYTE + 2u * place];
    return codec_decode(&PACK_GROUPS[group].scaling, bytes[0] | ((uint32_t)bytes[1] << 8u));
}

void pack_fill_page(can_frame_t *frame, uint32_t group, uint32_t page, const float *values,
                    uint32_t count)
{
    const codec_message_t *message = pack_page_message(group, page);
    frame->id = message->id;
    frame->length = message->length;
    frame->data[0] = 0u;
    frame->data[PAGE_BYTE] = (uint8_t)((page % PACK_PAGES_A_MESSAGE) << PAGE_SHIFT);
    for (uint32_t place = 0u; place < PACK_CELLS_A_PAGE; place++) {
        const uint32_t raw = codec_encode(&PACK_GROUPS[group].scaling,
                                          (place < count) ? values[place] : NAN, CODEC_NEAREST);
        frame->data[FIRST_VALUE_BYTE + 2u * place] = (uint8_t)raw;
        frame->data[FIRST_VALUE_BYTE + 2u * place + 1u] = (uint8_t)(raw >> 8u);
    }
}

uint32_t pack_cells_from(uint32_t cells, uint32_t page)
{
    const uint32_t first = page * PACK_CELLS_A_PAGE;
    const uint32_t left = (cells > first) ? (cells - first) : 0u;
    return (left < PACK_CELLS_A_PAGE) ? left : PACK_CELLS_A_PAGE;
}
