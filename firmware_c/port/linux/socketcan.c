#include "socketcan.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>

static bool set_option(int descriptor, int level, int option, const void *value, socklen_t size)
{
    return setsockopt(descriptor, level, option, value, size) == 0;
}

static bool configure(int descriptor)
{
    static const struct can_filter STANDARD_DATA_FRAMES = { 0u, CAN_EFF_FLAG | CAN_RTR_FLAG };
    static const int BYTES = SOCKETCAN_BUFFER_BYTES;
    /* Only a privileged process may go beyond the machine's limit. */
    return (set_option(descriptor, SOL_SOCKET, SO_RCVBUFFORCE, &BYTES, sizeof BYTES) ||
            set_option(descriptor, SOL_SOCKET, SO_RCVBUF, &BYTES, sizeof BYTES)) &&
           set_option(descriptor, SOL_CAN_RAW, CAN_RAW_FILTER, &STANDARD_DATA_FRAMES,
                      sizeof STANDARD_DATA_FRAMES);
}

bool socketcan_open(socketcan_t *bus, const char *interface)
{
    const unsigned int index = if_nametoindex(interface);
    struct sockaddr_can address = { .can_family = AF_CAN, .can_ifindex = (int)index };
    *bus = (socketcan_t){ .descriptor = socket(AF_CAN, SOCK_RAW, CAN_RAW) };
    if (bus->descriptor < 0) {
        bus->error = errno;
    } else if (index == 0u) {
        bus->error = ENODEV;
    } else if (!configure(bus->descriptor) ||
               (bind(bus->descriptor, (struct sockaddr *)&address, sizeof address) != 0)) {
        bus->error = errno;
    }
    return bus->error == 0;
}

bool socketcan_receive(socketcan_t *bus, can_frame_t *frame)
{
    struct can_frame wire;
    const ssize_t size = recv(bus->descriptor, &wire, sizeof wire, MSG_DONTWAIT);
    if (size < 0) {
        if ((errno != EAGAIN) && (errno != EINTR)) {
            bus->error = errno;
        }
        return false;
    }
    bus->received++;
    frame->id = wire.can_id & CAN_SFF_MASK;
    frame->length = wire.can_dlc;
    memcpy(frame->data, wire.data, sizeof frame->data);
    return true;
}

void socketcan_send(socketcan_t *bus, const can_frame_t *frame)
{
    struct can_frame wire = { .can_id = frame->id, .can_dlc = frame->length };
    memcpy(wire.data, frame->data, sizeof wire.data);
    if (send(bus->descriptor, &wire, sizeof wire, MSG_DONTWAIT) < 0) {
        if ((errno == EAGAIN) || (errno == ENOBUFS) || (errno == EINTR)) {
            bus->unsent++;
        } else {
            bus->error = errno;
        }
    }
}

uint32_t socketcan_unread(const socketcan_t *bus)
{
    uint32_t figures[SK_MEMINFO_VARS] = { 0u };
    socklen_t size = sizeof figures;
    (void)getsockopt(bus->descriptor, SOL_SOCKET, SO_MEMINFO, figures, &size);
    return figures[SK_MEMINFO_DROPS];
}

void socketcan_wait(const socketcan_t *bus, int timeout_ms)
{
    struct pollfd readable = { .fd = bus->descriptor, .events = POLLIN };
    (void)poll(&readable, 1u, timeout_ms);
}
