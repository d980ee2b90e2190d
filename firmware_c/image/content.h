/* What stands in flash, told by its bytes instead of by what its header or its maker say of it.
 *
 * The hash tells what was edited, or damaged beyond a checksum, from what was made. Whoever writes
 * the bytes can write a hash that fits, so that it authenticates nothing.
 */
#ifndef CONTENT_H
#define CONTENT_H

#include <stdint.h>

#include "calibration.h"

#ifdef __cplusplus
extern "C" {
#endif

/* First 64 bits of the SHA-256 of bytes. */
void content_hash(const uint8_t *bytes, uint32_t length, uint32_t hash[2]);

/* Bytes of a calibration that are used; behind the tables of its model nothing is read. */
uint32_t content_calibration_length(const bms_calibration_t *calibration);

/* First 32 bits of the SHA-256 of these bytes, as a bms_start_t wants them. */
uint32_t content_of_calibration(const bms_calibration_t *calibration);

#ifdef __cplusplus
}
#endif

#endif
