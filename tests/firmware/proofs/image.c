/* Any bytes in any place: the boot stage reads nothing outside of it, and starts nothing outside. */
#include "proof.h"

#include <stdlib.h>

#include "content.h"
#include "image.h"

/* In the place of SHA-256, of which nothing is relied on here. */
void content_hash(const uint8_t *bytes, uint32_t length, uint32_t hash[2])
{
    ANY(uint32_t, first);
    ANY(uint32_t, second);
    HOLDS((length == 0u) || __CPROVER_r_ok(bytes, length), "what is hashed is there");
    hash[0] = first;
    hash[1] = second;
}

uint32_t content_calibration_length(const bms_calibration_t *calibration)
{
    (void)calibration;
    ANY(uint32_t, length);
    return length;
}

#define MOST 144u

int main(void)
{
    ANY(image_memory_t, place);
    ANY(image_memory_t, ram);
    ANY(uint32_t, target);
    GRANTED(place.length <= MOST);
    place.bytes = malloc(place.length);
    GRANTED(place.bytes != 0);
    (void)image_check_boot(&place);
    GRANTED(place.address <= UINT32_MAX - MOST);
    GRANTED(ram.length <= UINT32_MAX - ram.address);
    if (image_check_application(&place, target, &ram) == IMAGE_OK) {
        const uint32_t *vectors = (const uint32_t *)&place.bytes[IMAGE_VECTORS_OFFSET];
        HOLDS((vectors[1] & 1u) != 0u, "code is Thumb code");
        HOLDS(vectors[1] - place.address < place.length, "it starts inside of its part");
        HOLDS(vectors[1] >= place.address + IMAGE_VECTORS_OFFSET, "behind its header");
        HOLDS(vectors[0] > ram.address && vectors[0] - ram.address <= ram.length,
              "its stack lies in RAM");
        HOLDS(vectors[0] % 8u == 0u, "aligned");
        HOLDS(((const image_header_t *)place.bytes)->target == target, "it is for this board");
    }
    return 0;
}
