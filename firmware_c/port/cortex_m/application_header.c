/* Header of the application. CRC and hashes are filled in after linking (bms/image/seal.py). */
#include "bms.h"
#include "image.h"

extern const uint8_t image_application_length[]; /* of the linker script: an address is the number */
extern const image_header_t APPLICATION_HEADER;

__attribute__((section(".application_header"), used)) const image_header_t APPLICATION_HEADER = {
    .magic = IMAGE_MAGIC_APPLICATION,
    .length = (uint32_t)image_application_length,
    .header_layout = IMAGE_HEADER_LAYOUT,
    .target = PORT_TARGET,
    .firmware_version = BMS_FIRMWARE_VERSION,
    .calibration_layout = BMS_CALIBRATION_LAYOUT,
    .calibration_length = sizeof(image_header_t) + sizeof(bms_calibration_t),
};
