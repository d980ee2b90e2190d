/* The ECU as a unit of a co-simulation: the firmware's main loop on a clock that the importer moves,
 * with its frames in bus operations. A port of the firmware, see port.h. */
#ifndef ECU_UNIT_H
#define ECU_UNIT_H

#include <stdbool.h>
#include <stdint.h>

#include "bus_node.h"
#include "ecu_loop.h"
#include "image.h"

#define ECU_UNIT_CALIBRATION_BYTES (sizeof(image_header_t) + sizeof(bms_calibration_t))
#define ECU_UNIT_MESSAGE_BYTES 512

typedef struct {
    ecu_loop_t loop;
    bus_node_t node;
    double now_s;
    const can_frame_t *arriving;
    uint64_t calibration[(ECU_UNIT_CALIBRATION_BYTES + 7u) / 8u]; /* the part, header included */
} ecu_unit_t;

/* Reads calibration.bin of a folder and checks it as a boot stage does. False when it cannot be
 * used, with the reason and the remedy in `message`. */
bool ecu_unit_load(ecu_unit_t *unit, const char *folder, char message[ECU_UNIT_MESSAGE_BYTES]);

/* Starts the firmware at a time, with the calibration that has been loaded. */
void ecu_unit_start(ecu_unit_t *unit, double now_s);

/* Takes the bus operations of one event. */
void ecu_unit_receive(ecu_unit_t *unit, const uint8_t *operations, uint32_t length);

/* Runs a control period if one is due by the firmware's own clock. */
void ecu_unit_follow_clock(ecu_unit_t *unit);

/* Time in s until there is something to send, as far as it is known; 0 when there is. */
bool ecu_unit_interval(const ecu_unit_t *unit, double *interval_s);

#endif
