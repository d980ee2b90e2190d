/* Header of the calibration that is built in. CRC and hashes are filled in after linking. */
#include "bms.h"
#include "image.h"

extern const uint8_t image_calibration_length[]; /* of the linker script: an address is the number */

extern const image_header_t CALIBRATION_HEADER;

__attribute__((section(".calibration_header"), used)) const image_header_t CALIBRATION_HEADER = {
    .magic = IMAGE_MAGIC_CALIBRATION,
    .length = (uint32_t)image_calibration_length,
    .header_layout = IMAGE_HEADER_LAYOUT,
    .target = IMAGE_ANY_TARGET,
    .firmware_version = BMS_FIRMWARE_VERSION,
    .calibration_layout = BMS_CALIBRATION_LAYOUT,
    .calibration_length = sizeof(image_header_t) + sizeof(bms_calibration_t),
};
