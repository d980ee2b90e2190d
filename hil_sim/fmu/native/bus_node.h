/* The CAN controller of a unit, as far as a bus simulation can notice it: what it sends, its error
 * counters and its state (ISO 11898-1, FMI-LS-BUS 1.0.0). */
#ifndef BUS_NODE_H
#define BUS_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"
#include "bus_operations.h"

#define BUS_NODE_BAUDRATE 500000u

/* Values of the Status operation. */
typedef enum { BUS_NODE_ACTIVE = 1, BUS_NODE_PASSIVE = 2, BUS_NODE_OFF = 3 } bus_node_state_t;

typedef struct {
    bus_outgoing_t outgoing;
    bus_node_state_t state;
    uint32_t transmit_errors;
    uint32_t receive_errors;
    double off_since_s;
    uint32_t messages; /* sent so far, the last frame of each kept for one that loses arbitration */
    can_frame_t last[BMS_TRANSMITTED_MESSAGES];
    uint32_t lost; /* frames that found no room, or the node off the bus */
} bus_node_t;

/* Error active, with the configuration of the bus on its way out. */
void bus_node_init(bus_node_t *node);

/* Puts a frame on its way; lost, and counted, while the node is off the bus. */
void bus_node_send(bus_node_t *node, const can_frame_t *frame, double now_s);

/* A frame has been received intact: a passive receiver is active again. */
void bus_node_heard(bus_node_t *node, double now_s);

/* Takes every operation that carries no frame; one that cannot be read is answered. */
void bus_node_take(bus_node_t *node, const bus_operation_t *operation, double now_s);

#endif
