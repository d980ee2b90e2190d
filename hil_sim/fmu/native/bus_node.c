#include "bus_node.h"

#include <string.h>

#define PASSIVE_FROM 128u
#define OFF_FROM 256u
#define SENDER_PENALTY 8u
#define FIRST_RECEIVER_PENALTY 8u
#define PRIMARY_ERROR_FLAG 1u

/* A node that is off returns after 128 times 11 recessive bits. */
#define RECOVERY_S (128.0 * 11.0 / (double)BUS_NODE_BAUDRATE)

/* Length of each operation behind its header; those of another length are damaged. */
#define CONFIRM_BYTES 4u
#define BUS_ERROR_BYTES 7u

void bus_node_init(bus_node_t *node)
{
    memset(node, 0, sizeof *node);
    node->state = BUS_NODE_ACTIVE;
    (void)bus_configure_baudrate(&node->outgoing, BUS_NODE_BAUDRATE);
    (void)bus_configure_buffering(&node->outgoing);
}

static void follow_counters(bus_node_t *node, double now_s)
{
    bus_node_state_t state = BUS_NODE_ACTIVE;
    if (node->transmit_errors >= OFF_FROM) {
        state = BUS_NODE_OFF;
    } else if ((node->transmit_errors >= PASSIVE_FROM) || (node->receive_errors >= PASSIVE_FROM)) {
        state = BUS_NODE_PASSIVE;
    }
    if (state != node->state) {
        node->state = state;
        node->off_since_s = now_s;
        (void)bus_tell_status(&node->outgoing, (uint8_t)state);
    }
}

/* Place of the last frame with an identifier; that behind the last one where there was none. */
static uint32_t place_of(const bus_node_t *node, uint32_t id)
{
    uint32_t i = 0u;
    while ((i < node->messages) && (node->last[i].id != id)) {
        i++;
    }
    return i;
}

static void keep(bus_node_t *node, const can_frame_t *frame)
{
    const uint32_t place = place_of(node, frame->id);
    if (place < BMS_TRANSMITTED_MESSAGES) {
        node->last[place] = *frame;
        node->messages = (place < node->messages) ? node->messages : place + 1u;
    }
}

static void put_on_bus(bus_node_t *node, const can_frame_t *frame)
{
    if (!bus_transmit(&node->outgoing, frame)) {
        node->lost++;
    }
}

void bus_node_send(bus_node_t *node, const can_frame_t *frame, double now_s)
{
    if ((node->state == BUS_NODE_OFF) && (now_s - node->off_since_s >= RECOVERY_S)) {
        node->transmit_errors = 0u;
        node->receive_errors = 0u;
        follow_counters(node, now_s);
    }
    if (node->state == BUS_NODE_OFF) {
        node->lost++;
        return;
    }
    keep(node, frame);
    put_on_bus(node, frame);
}

static void forgive(uint32_t *errors)
{
    if (*errors > 0u) {
        *errors -= 1u;
    }
}

void bus_node_heard(bus_node_t *node, double now_s)
{
    if (node->receive_errors >= PASSIVE_FROM) {
        node->receive_errors = PASSIVE_FROM;
    }
    forgive(&node->receive_errors);
    follow_counters(node, now_s);
}

static void send_again(bus_node_t *node, uint32_t id)
{
    const uint32_t place = place_of(node, id);
    if ((place < node->messages) && (node->state != BUS_NODE_OFF)) {
        put_on_bus(node, &node->last[place]);
    }
}

static void count_error(bus_node_t *node, const bus_operation_t *operation)
{
    const bool is_first = bus_byte(operation, 5u) == PRIMARY_ERROR_FLAG;
    const bool is_sender = bus_byte(operation, 6u) != 0u;
    if (node->state == BUS_NODE_OFF) {
        return;
    }
    if (is_sender) {
        node->transmit_errors += SENDER_PENALTY;
    } else {
        node->receive_errors += is_first ? FIRST_RECEIVER_PENALTY : 1u;
    }
}

void bus_node_take(bus_node_t *node, const bus_operation_t *operation, double now_s)
{
    const uint32_t arguments = operation->length - BUS_HEADER_BYTES;
    bool is_read = !operation->is_damaged;
    switch (is_read ? operation->code : 0u) {
    case BUS_CONFIRM:
        is_read = arguments == CONFIRM_BYTES;
        if (is_read && (node->state != BUS_NODE_OFF)) {
            forgive(&node->transmit_errors);
        }
        break;
    case BUS_ARBITRATION_LOST:
        is_read = arguments == CONFIRM_BYTES;
        if (is_read) {
            send_again(node, bus_number(operation, 0u));
        }
        break;
    case BUS_ERROR:
        is_read = arguments == BUS_ERROR_BYTES;
        if (is_read) {
            count_error(node, operation);
        }
        break;
    case BUS_FORMAT_ERROR: /* not answered, so that two nodes do not accuse each other for ever */
    case BUS_CONFIGURATION:
    case BUS_STATUS:
    case BUS_WAKEUP:
    case BUS_CAN_FD_TRANSMIT: /* a classic controller takes none */
    case BUS_CAN_XL_TRANSMIT:
        break;
    default:
        is_read = false;
        break;
    }
    if (!is_read) {
        (void)bus_tell_format_error(&node->outgoing, operation);
    }
    follow_counters(node, now_s);
}
