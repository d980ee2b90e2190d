/* Many classical CAN frames by one system call each way: sendmmsg and recvmmsg of Linux.
 *
 * Elsewhere both calls say that there is no such thing, and python-can carries frame by frame.
 */
#ifndef SOCKETCAN_BATCH_H
#define SOCKETCAN_BATCH_H

#include <stdint.h>

#define SOCKETCAN_BATCH_FRAMES 32

#define SOCKETCAN_CLASSICAL_BYTES 16 /* of a frame for the kernel; one of CAN FD has more */

/* Bytes that came; then as struct canfd_frame of linux/can.h, whose begin is a struct can_frame:
 * identifier with its flags, length, data. */
typedef struct {
    uint32_t size;
    uint32_t id;
    uint8_t length;
    uint8_t reserved[3];
    uint8_t data[64];
} socketcan_frame_t;

/* Classical frames sent without waiting, 0 where none could be; -errno where the first one failed. */
int32_t socketcan_send(int32_t socket, socketcan_frame_t *frames, uint32_t count);

/* Frames that have come, at most SOCKETCAN_BATCH_FRAMES, without waiting; -errno. */
int32_t socketcan_receive(int32_t socket, socketcan_frame_t *frames);

#endif
