/* Frames of a pack: fields and pages by the generated tables, scaling by codec.h. */
#ifndef PACK_CODEC_H
#define PACK_CODEC_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "pack_catalog.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The bits of a frame, of which the first byte is the lowest. */
uint64_t pack_bits(const can_frame_t *frame);

/* Sets length, identifier and content of a frame; protection comes on top. */
void pack_fill(can_frame_t *frame, const codec_message_t *message, uint64_t bits);

/* A value, or NaN where it is not available. */
float pack_value(uint64_t bits, uint32_t signal);

uint32_t pack_code(uint64_t bits, uint32_t signal);

uint64_t pack_with_value(uint32_t signal, float value, codec_rounding_t rounding);

uint64_t pack_with_code(uint32_t signal, uint32_t code);

/* Page of a frame of a group among those of all its messages; false for a frame of no page. */
bool pack_page_of(uint32_t group, const can_frame_t *frame, uint32_t *page);

/* Message that a page is of. */
const codec_message_t *pack_page_message(uint32_t group, uint32_t page);

/* Pages of a group that hold so many cells. */
uint32_t pack_pages(uint32_t cells);

/* Value of a cell of a page, 0 to PACK_CELLS_A_PAGE - 1. */
float pack_page_value(uint32_t group, const can_frame_t *frame, uint32_t place);

/* Fills a frame with a page of so many values; what it has room for beyond them is not available. */
void pack_fill_page(can_frame_t *frame, uint32_t group, uint32_t page, const float *values,
                    uint32_t count);

/* Cells from a page on to the last one, of which a page holds PACK_CELLS_A_PAGE at most. */
uint32_t pack_cells_from(uint32_t cells, uint32_t page);

#ifdef __cplusplus
}
#endif

#endif
