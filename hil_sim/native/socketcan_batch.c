#if defined(__linux__)
#define _GNU_SOURCE /* sendmmsg, recvmmsg */
#endif

#include "socketcan_batch.h"

#include <errno.h>
#include <stddef.h>
#include <string.h>

#if defined(__linux__)
#include <sys/socket.h>
#include <sys/uio.h>

typedef struct {
    struct mmsghdr header[SOCKETCAN_BATCH_FRAMES];
    struct iovec piece[SOCKETCAN_BATCH_FRAMES];
} batch_t;

static void lay_out(batch_t *batch, socketcan_frame_t *frames, uint32_t count, size_t bytes)
{
    memset(batch->header, 0, sizeof batch->header);
    for (uint32_t i = 0u; i < count; i++) {
        batch->piece[i].iov_base = &frames[i].id;
        batch->piece[i].iov_len = bytes;
        batch->header[i].msg_hdr.msg_iov = &batch->piece[i];
        batch->header[i].msg_hdr.msg_iovlen = 1u;
    }
}

static int32_t frames_or_error(int result)
{
    if (result >= 0) {
        return result;
    }
    return ((errno == EAGAIN) || (errno == EWOULDBLOCK)) ? 0 : -errno;
}

int32_t socketcan_send(int32_t socket, socketcan_frame_t *frames, uint32_t count)
{
    batch_t batch;
    const uint32_t most = (count < SOCKETCAN_BATCH_FRAMES) ? count : SOCKETCAN_BATCH_FRAMES;
    lay_out(&batch, frames, most, SOCKETCAN_CLASSICAL_BYTES);
    return frames_or_error(sendmmsg(socket, batch.header, most, MSG_DONTWAIT));
}

int32_t socketcan_receive(int32_t socket, socketcan_frame_t *frames)
{
    batch_t batch;
    lay_out(&batch, frames, SOCKETCAN_BATCH_FRAMES, sizeof frames[0] - sizeof frames[0].size);
    const int32_t count = frames_or_error(
        recvmmsg(socket, batch.header, SOCKETCAN_BATCH_FRAMES, MSG_DONTWAIT, NULL));
    for (int32_t i = 0; i < count; i++) {
        frames[i].size = batch.header[i].msg_len;
    }
    return count;
}
#else
int32_t socketcan_send(int32_t socket, socketcan_frame_t *frames, uint32_t count)
{
    (void)socket;
    (void)frames;
    (void)count;
    return -ENOSYS;
}

int32_t socketcan_receive(int32_t socket, socketcan_frame_t *frames)
{
    (void)socket;
    (void)frames;
    return -ENOSYS;
}
#endif
