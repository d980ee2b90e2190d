/* The parts of an image: a boot stage, and application and calibration, which can be replaced and
 * begin with a header. Boot stage and host check them by the same code. All numbers are
 * little-endian.
 */
#ifndef IMAGE_H
#define IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define IMAGE_MAGIC_APPLICATION 0x50414D42u /* the text BMAP */
#define IMAGE_MAGIC_CALIBRATION 0x41434D42u /* the text BMCA */

/* Raised whenever image_header_t changes. */
#define IMAGE_HEADER_LAYOUT 2u

/* Where an application's vector table stands in its part. */
#define IMAGE_VECTORS_OFFSET 128u

/* A calibration part fits every target. */
#define IMAGE_ANY_TARGET 0u

typedef struct {
    uint32_t magic;
    uint32_t crc32;              /* of the part from the next field to its end */
    uint32_t length;             /* bytes of the part, header included */
    uint32_t header_layout;      /* IMAGE_HEADER_LAYOUT */
    uint32_t target;             /* board that the code is for, or IMAGE_ANY_TARGET */
    uint32_t firmware_version;   /* of the application, or the one that the calibration is for */
    uint32_t calibration_layout; /* BMS_CALIBRATION_LAYOUT that it was compiled or written for */
    uint32_t calibration_length; /* most bytes of a calibration part in it, header included */
    uint32_t model_hash;         /* as in the calibration; in an application, of the default one */
    uint32_t preset_hash;
    uint32_t content_hash; /* of what follows the header, the first 64 bits of its SHA-256 */
    uint32_t content_hash_rest;
} image_header_t;

/* The first thing that is wrong, in the order of the checks. */
typedef enum {
    IMAGE_OK = 0,
    IMAGE_NO_MAGIC = 1,     /* no part at all, or one of the other kind */
    IMAGE_WRONG_LENGTH = 2, /* does not fit into its place, or has not all its bytes */
    IMAGE_WRONG_CRC = 3,
    IMAGE_WRONG_HEADER_LAYOUT = 4,
    IMAGE_WRONG_TARGET = 5,
    IMAGE_WRONG_VECTORS = 6,           /* start address or stack outside of where they must be */
    IMAGE_WRONG_CALIBRATION_LAYOUT = 7, /* not the one that the application was compiled for */
    IMAGE_WRONG_FIRMWARE_VERSION = 8,   /* made for another application */
    IMAGE_WRONG_CONTENT = 9, /* header and calibration name different origins or lengths */
    IMAGE_WRONG_HASH = 10,   /* edited since it was made, whatever its CRC says */
    IMAGE_ROLLED_BACK = 11,  /* older than the oldest firmware that the board takes */
    IMAGE_WRONG_FLOOR = 12,  /* the record of that version is damaged */
    IMAGE_REPEATED_FAULTS = 13, /* the application restarts again and again: processor faults, */
    IMAGE_REPEATED_WATCHDOG = 14, /* it hangs, */
    IMAGE_REPEATED_RESETS = 15    /* or the cause is not known */
} image_status_t;

/* In a sector of its own: the oldest firmware version that the board takes. Erased, it takes any. */
typedef struct {
    uint32_t version;
    uint32_t inverted_version; /* ~version: a damaged record is no record */
} image_floor_t;

/* Memory that holds a part, or that an application may use. */
typedef struct {
    const uint8_t *bytes; /* aligned to 8 bytes; what is at `address`, for a host elsewhere */
    uint32_t address;     /* on the target */
    uint32_t length;
} image_memory_t;

/* CRC-32 of IEEE 802.3, as in zip files. */
uint32_t image_crc32(const uint8_t *bytes, uint32_t length);

/* Whether the boot stage is whole: its last word is the CRC-32 of what stands before it. */
image_status_t image_check_boot(const image_memory_t *place);

/* Whether a target may start the application; nothing is read of `ram`. */
image_status_t image_check_application(const image_memory_t *place, uint32_t target,
                                       const image_memory_t *ram);

/* Whether an application that has been checked is as new as the floor wants. */
image_status_t image_check_floor(const image_memory_t *place, const image_header_t *application);

/* Whether an application that has been checked may use the calibration. */
image_status_t image_check_calibration(const image_memory_t *place,
                                       const image_header_t *application);

#ifdef __cplusplus
}
#endif

#endif
