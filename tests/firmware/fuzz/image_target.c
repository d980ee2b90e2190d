/* Parts of an image, in memory that ends where they do, against what they must be to be taken. */
#include "content.h"
#include "image.h"
#include "input.h"

#define HEADER ((uint32_t)sizeof(image_header_t))
#define CALIBRATION_LAYOUT 5u
#define TARGET 1u

typedef enum { SEAL_WHOLE, SEAL_NONE, SEAL_CHECKSUM } seal_t;

static const image_memory_t RAM = { NULL, 0x20000000u, 0x1000u };

/* Bit by bit, another way than the table under test. */
static uint32_t crc32_of(const uint8_t *bytes, uint32_t length)
{
    uint32_t crc = UINT32_MAX;
    for (uint32_t i = 0u; i < length; i++) {
        crc ^= bytes[i];
        for (uint32_t bit = 0u; bit < 8u; bit++) {
            crc = (crc >> 1u) ^ (((crc & 1u) != 0u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

/* As somebody does who edits a part: checksum and, if he knows of it, hash of what is there. */
static void seal(uint8_t *part, uint32_t length, seal_t kind)
{
    image_header_t header;
    if ((length < HEADER) || (kind == SEAL_NONE)) {
        return;
    }
    memcpy(&header, part, HEADER);
    if ((header.length < HEADER) || (header.length > length)) {
        return;
    }
    if (kind == SEAL_WHOLE) {
        uint32_t hash[2];
        content_hash(&part[HEADER], header.length - HEADER, hash);
        header.content_hash = hash[0];
        header.content_hash_rest = hash[1];
    }
    memcpy(part, &header, HEADER);
    header.crc32 = crc32_of(&part[8], header.length - 8u);
    memcpy(part, &header, HEADER);
}

static void hold_part(const image_memory_t *place, uint32_t magic)
{
    const image_header_t *header = (const image_header_t *)(const void *)place->bytes;
    uint32_t hash[2];
    MUST(place->length >= HEADER, "a part without a header is taken");
    MUST(header->magic == magic, "a part of another kind is taken");
    MUST((header->length > HEADER) && (header->length <= place->length),
         "a part that does not fit its place is taken");
    MUST(header->crc32 == crc32_of(&place->bytes[8], header->length - 8u),
         "a damaged part is taken");
    MUST(header->header_layout == 2u, "a header of another layout is taken");
    content_hash(&place->bytes[HEADER], header->length - HEADER, hash);
    MUST((hash[0] == header->content_hash) && (hash[1] == header->content_hash_rest),
         "an edited part is taken");
}

static void check_boot(input_t *input, seal_t kind)
{
    const uint32_t length = (uint32_t)input->left;
    uint8_t *bytes = malloc(length + 1u);
    const image_memory_t place = { bytes, 0u, length & ~3u };
    memcpy(bytes, input->bytes, length);
    if ((kind != SEAL_NONE) && (place.length >= 4u)) {
        const uint32_t crc32 = crc32_of(bytes, place.length - 4u);
        memcpy(&bytes[place.length - 4u], &crc32, 4u);
    }
    if (image_check_boot(&place) == IMAGE_OK) {
        uint32_t crc32;
        MUST(place.length >= 4u, "a boot stage without a checksum is taken");
        memcpy(&crc32, &bytes[place.length - 4u], 4u);
        MUST(crc32 == crc32_of(bytes, place.length - 4u), "a damaged boot stage is taken");
    }
    free(bytes);
}

static void check_application(input_t *input, seal_t kind)
{
    const image_header_t good = { .magic = IMAGE_MAGIC_APPLICATION,
                                  .length = 192u,
                                  .header_layout = 2u,
                                  .target = TARGET,
                                  .firmware_version = 4u };
    static const uint32_t VECTORS[2] = { 0x20001000u, 0x1081u };
    const uint32_t length = input_16(input) % 512u & ~3u;
    uint8_t *bytes = calloc(1u, 512u);
    memcpy(bytes, &good, HEADER);
    memcpy(&bytes[IMAGE_VECTORS_OFFSET], VECTORS, sizeof VECTORS);
    input_patch(input, bytes, 512u);
    seal(bytes, length, kind);
    uint8_t *part = malloc(length + 1u);
    memcpy(part, bytes, length);
    const image_memory_t place = { part, 0x1000u, length };
    if (image_check_application(&place, TARGET, &RAM) == IMAGE_OK) {
        const image_header_t *header = (const image_header_t *)(const void *)part;
        const uint32_t *vectors = (const uint32_t *)(const void *)&part[IMAGE_VECTORS_OFFSET];
        hold_part(&place, IMAGE_MAGIC_APPLICATION);
        MUST(header->target == TARGET, "an application for another board is taken");
        MUST((vectors[0] > RAM.address) && (vectors[0] <= RAM.address + RAM.length) &&
                 (vectors[0] % 8u == 0u),
             "a stack outside of RAM is taken");
        MUST((vectors[1] >= place.address + IMAGE_VECTORS_OFFSET) &&
                 (vectors[1] < place.address + header->length) && (vectors[1] % 2u == 1u),
             "a start outside of the part is taken");
        image_floor_t floor = { input_32(input), input_32(input) };
        const image_memory_t floor_place = { (const uint8_t *)&floor, 0u, sizeof floor };
        if (image_check_floor(&floor_place, header) == IMAGE_OK) {
            const bool is_erased =
                (floor.version == UINT32_MAX) && (floor.inverted_version == UINT32_MAX);
            MUST(is_erased || (floor.version == ~floor.inverted_version), "a damaged floor is taken");
            MUST(is_erased || (floor.version <= header->firmware_version),
                 "an application older than the floor is taken");
        }
    }
    free(part);
    free(bytes);
}

/* Bytes of the calibration that the sizes of its model make; 0 where these are beyond all bounds. */
static uint64_t used_length(const bms_calibration_t *calibration)
{
    const kan_model_t *model = &calibration->kan;
    uint64_t edges = 0u;
    if ((model->layers == 0u) || (model->layers > KAN_MAX_LAYERS) || (model->cells == 0u) ||
        (model->cells >= KAN_MAX_KNOTS)) {
        return 0u;
    }
    for (uint32_t layer = 0u; layer < model->layers; layer++) {
        edges += (uint64_t)model->width[layer] * model->width[layer + 1u];
    }
    const uint64_t of_edge = (uint64_t)model->cells + 1u + 8u * (uint64_t)model->cells;
    return (uint64_t)((const uint8_t *)model->tables - (const uint8_t *)calibration) +
           4u * edges * of_edge;
}

static void check_calibration(input_t *input, seal_t kind)
{
    static uint8_t bytes[HEADER + sizeof(bms_calibration_t) + 64u];
    const image_header_t application = { .calibration_layout = CALIBRATION_LAYOUT,
                                         .calibration_length = sizeof bytes,
                                         .firmware_version = 4u };
    const uint32_t used = content_calibration_length(&BMS_DEFAULT_CALIBRATION);
    image_header_t header = {
        .magic = IMAGE_MAGIC_CALIBRATION,
        .length = HEADER + used,
        .header_layout = 2u,
        .firmware_version = 4u,
        .calibration_layout = CALIBRATION_LAYOUT,
        .calibration_length = sizeof bytes,
        .model_hash = BMS_DEFAULT_CALIBRATION.model_hash,
        .preset_hash = BMS_DEFAULT_CALIBRATION.preset_hash,
    };
    memset(bytes, 0xFF, sizeof bytes);
    memcpy(&bytes[HEADER], &BMS_DEFAULT_CALIBRATION, sizeof BMS_DEFAULT_CALIBRATION);
    const uint32_t wanted = input_16(input);
    if (wanted != 0u) { /* cut off, or with bytes behind its end */
        header.length = wanted;
    }
    memcpy(bytes, &header, HEADER);
    input_patch(input, bytes, sizeof bytes);
    memcpy(&header, bytes, HEADER);
    const uint32_t length = (header.length < sizeof bytes) ? header.length : (uint32_t)sizeof bytes;
    seal(bytes, length, kind);
    uint8_t *part = malloc(length + 1u);
    memcpy(part, bytes, length);
    const image_memory_t place = { part, 0x8000u, length };
    if (image_check_calibration(&place, &application) == IMAGE_OK) {
        const image_header_t *taken = (const image_header_t *)(const void *)part;
        bms_calibration_t content;
        hold_part(&place, IMAGE_MAGIC_CALIBRATION);
        MUST(taken->length >= HEADER + offsetof(bms_calibration_t, kan) + offsetof(kan_model_t, tables),
             "a calibration that ends before its model is taken");
        memset(&content, 0, sizeof content);
        memcpy(&content, &part[HEADER],
               (length - HEADER < sizeof content) ? length - HEADER : sizeof content);
        MUST(content.layout == CALIBRATION_LAYOUT, "a calibration of another layout is taken");
        MUST(taken->length == HEADER + used_length(&content),
             "a calibration whose tables do not end with it is taken");
        MUST((taken->firmware_version == 4u) && (taken->calibration_length == sizeof bytes) &&
                 (taken->calibration_layout == CALIBRATION_LAYOUT),
             "a calibration for another application is taken");
        MUST((taken->model_hash == content.model_hash) && (taken->preset_hash == content.preset_hash),
             "a calibration of another origin than its header names is taken");
    }
    free(part);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
    input_t input = { bytes, length };
    const uint8_t choice = input_byte(&input);
    const seal_t kind = ((choice & 4u) == 0u) ? SEAL_WHOLE : (choice & 8u) ? SEAL_CHECKSUM : SEAL_NONE;
    switch (choice & 3u) {
    case 0u:
        check_calibration(&input, kind);
        break;
    case 1u:
        check_application(&input, kind);
        break;
    default:
        check_boot(&input, kind);
        break;
    }
    return 0;
}
