#include "image.h"

#include <stddef.h>

#include "calibration.h"
#include "content.h"

#define CRC32_START 0xFFFFFFFFu
#define CRC_COVERS_FROM offsetof(image_header_t, length)
#define SHORTEST_APPLICATION (IMAGE_VECTORS_OFFSET + 2u * (uint32_t)sizeof(uint32_t))
/* What every layout begins with: layout and hashes. */
#define SHORTEST_CALIBRATION \
    ((uint32_t)(sizeof(image_header_t) + offsetof(bms_calibration_t, sampling_period_s)))
/* What every calibration of this layout has: all up to the tables, and with it their number. */
#define UP_TO_TABLES                                                                  \
    ((uint32_t)sizeof(image_header_t) + (uint32_t)offsetof(bms_calibration_t, kan) + \
     (uint32_t)offsetof(kan_model_t, tables))
#define ERASED 0xFFFFFFFFu
#define THUMB_BIT 1u
#define STACK_ALIGNMENT 8u

typedef char header_has_no_padding[(sizeof(image_header_t) == 48u) ? 1 : -1];
typedef char header_ends_before_the_vectors[(sizeof(image_header_t) <= IMAGE_VECTORS_OFFSET) ? 1
                                                                                             : -1];
typedef char calibration_stays_aligned[(sizeof(image_header_t) % 8u == 0u) ? 1 : -1];

/* Remainders of the sixteen values of four bits for the reflected polynomial 0xEDB88320. */
static const uint32_t CRC32_OF_HALF_BYTE[16] = {
    0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
    0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
    0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
};

uint32_t image_crc32(const uint8_t *bytes, uint32_t length)
{
    uint32_t crc = CRC32_START;
    for (uint32_t i = 0u; i < length; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4u) ^ CRC32_OF_HALF_BYTE[crc & 15u];
        crc = (crc >> 4u) ^ CRC32_OF_HALF_BYTE[crc & 15u];
    }
    return ~crc;
}

static bool has_its_content(const image_header_t *header, const uint8_t *part)
{
    uint32_t hash[2];
    content_hash(&part[sizeof *header], header->length - (uint32_t)sizeof *header, hash);
    return (hash[0] == header->content_hash) && (hash[1] == header->content_hash_rest);
}

static const image_header_t *header_of(const image_memory_t *place)
{
    return (const image_header_t *)(const void *)place->bytes;
}

/* What both kinds have in common. The length comes before the CRC, which relies on it. */
static image_status_t check_part(const image_memory_t *place, uint32_t magic, uint32_t shortest)
{
    const image_header_t *header = header_of(place);
    if ((place->length < sizeof *header) || (header->magic != magic)) {
        return IMAGE_NO_MAGIC;
    }
    if ((header->length < shortest) || (header->length > place->length)) {
        return IMAGE_WRONG_LENGTH;
    }
    if (image_crc32(&place->bytes[CRC_COVERS_FROM], header->length - (uint32_t)CRC_COVERS_FROM) !=
        header->crc32) {
        return IMAGE_WRONG_CRC;
    }
    if (header->header_layout != IMAGE_HEADER_LAYOUT) {
        return IMAGE_WRONG_HEADER_LAYOUT;
    }
    return has_its_content(header, place->bytes) ? IMAGE_OK : IMAGE_WRONG_HASH;
}

image_status_t image_check_boot(const image_memory_t *place)
{
    if (place->length < sizeof(uint32_t)) {
        return IMAGE_WRONG_LENGTH;
    }
    const uint32_t covered = place->length - (uint32_t)sizeof(uint32_t);
    const uint32_t *crc32 = (const uint32_t *)(const void *)&place->bytes[covered];
    return (image_crc32(place->bytes, covered) == *crc32) ? IMAGE_OK : IMAGE_WRONG_CRC;
}

/* An address below the start wraps around to a large distance. */
static bool is_inside(uint32_t address, uint32_t start, uint32_t length)
{
    return address - start < length;
}

image_status_t image_check_application(const image_memory_t *place, uint32_t target,
                                       const image_memory_t *ram)
{
    const image_status_t status = check_part(place, IMAGE_MAGIC_APPLICATION, SHORTEST_APPLICATION);
    if (status != IMAGE_OK) {
        return status;
    }
    const image_header_t *header = header_of(place);
    if (header->target != target) {
        return IMAGE_WRONG_TARGET;
    }
    const uint32_t *vectors = (const uint32_t *)(const void *)&place->bytes[IMAGE_VECTORS_OFFSET];
    const uint32_t stack_top = vectors[0];
    const uint32_t start = vectors[1];
    const bool is_stack_right =
        (stack_top % STACK_ALIGNMENT == 0u) && is_inside(stack_top - 1u, ram->address, ram->length);
    const bool is_start_right =
        ((start & THUMB_BIT) != 0u) &&
        is_inside(start, place->address + IMAGE_VECTORS_OFFSET,
                  header->length - IMAGE_VECTORS_OFFSET);
    return (is_stack_right && is_start_right) ? IMAGE_OK : IMAGE_WRONG_VECTORS;
}

image_status_t image_check_floor(const image_memory_t *place, const image_header_t *application)
{
    const image_floor_t *floor = (const image_floor_t *)(const void *)place->bytes;
    if ((floor->version == ERASED) && (floor->inverted_version == ERASED)) {
        return IMAGE_OK;
    }
    if (floor->inverted_version != ~floor->version) {
        return IMAGE_WRONG_FLOOR;
    }
    return (application->firmware_version >= floor->version) ? IMAGE_OK : IMAGE_ROLLED_BACK;
}

image_status_t image_check_calibration(const image_memory_t *place,
                                       const image_header_t *application)
{
    const image_status_t status =
        check_part(place, IMAGE_MAGIC_CALIBRATION, SHORTEST_CALIBRATION);
    if (status != IMAGE_OK) {
        return status;
    }
    const image_header_t *header = header_of(place);
    if ((header->calibration_layout != application->calibration_layout) ||
        (header->calibration_length != application->calibration_length)) {
        return IMAGE_WRONG_CALIBRATION_LAYOUT;
    }
    if (header->firmware_version != application->firmware_version) {
        return IMAGE_WRONG_FIRMWARE_VERSION;
    }
    const bms_calibration_t *calibration =
        (const bms_calibration_t *)(const void *)&place->bytes[sizeof *header];
    const bool has_layout = calibration->layout == header->calibration_layout;
    const bool is_short = has_layout && (header->length < UP_TO_TABLES);
    const bool is_its_own =
        has_layout && !is_short &&
        (header->length == sizeof *header + content_calibration_length(calibration)) &&
        (calibration->model_hash == header->model_hash) &&
        (calibration->preset_hash == header->preset_hash);
    const image_status_t wrong = is_short ? IMAGE_WRONG_LENGTH : IMAGE_WRONG_CONTENT;
    return is_its_own ? IMAGE_OK : wrong;
}
