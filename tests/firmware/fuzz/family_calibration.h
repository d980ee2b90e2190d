/* A calibration of a family of cells as it stands in flash; build.py makes it of a shipped preset. */
#ifndef FAMILY_CALIBRATION_H
#define FAMILY_CALIBRATION_H

#include <stddef.h>

extern const unsigned char FAMILY_CALIBRATION[];
extern const size_t FAMILY_CALIBRATION_BYTES;

#endif
