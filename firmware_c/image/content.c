#include "content.h"

#include <stddef.h>

#include "sha256.h"

void content_hash(const uint8_t *bytes, uint32_t length, uint32_t hash[2])
{
    uint32_t digest[SHA256_WORDS];
    sha256(bytes, length, digest);
    hash[0] = digest[0];
    hash[1] = digest[1];
}

uint32_t content_calibration_length(const bms_calibration_t *calibration)
{
    return (uint32_t)offsetof(bms_calibration_t, kan) + kan_model_length(&calibration->kan);
}

uint32_t content_of_calibration(const bms_calibration_t *calibration)
{
    uint32_t hash[2];
    content_hash((const uint8_t *)(const void *)calibration,
                 content_calibration_length(calibration), hash);
    return hash[0];
}
