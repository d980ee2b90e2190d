/* One classic CAN frame with an 11-bit identifier, as the carriers hand it over. */
#ifndef CAN_FRAME_H
#define CAN_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint32_t id;
    uint8_t length;
    uint8_t data[8];
} can_frame_t;

#ifdef __cplusplus
}
#endif

#endif
