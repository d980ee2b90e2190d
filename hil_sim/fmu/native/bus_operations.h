/* Bus operations of FMI-LS-BUS 1.0.0 for CAN: what two units on a bus say to each other.
 *
 * An operation is a code and a length of four bytes each, the length counting both, and arguments.
 * All numbers are little-endian.
 */
#ifndef BUS_OPERATIONS_H
#define BUS_OPERATIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "can_frame.h"

#define BUS_FORMAT_ERROR 0x01u
#define BUS_CAN_TRANSMIT 0x10u
#define BUS_CAN_FD_TRANSMIT 0x11u
#define BUS_CAN_XL_TRANSMIT 0x12u
#define BUS_CONFIRM 0x20u
#define BUS_ARBITRATION_LOST 0x30u
#define BUS_ERROR 0x31u
#define BUS_CONFIGURATION 0x40u
#define BUS_STATUS 0x41u
#define BUS_WAKEUP 0x42u

#define BUS_HEADER_BYTES 8u

/* An operation as it stands in a buffer. One that has less than a header, or says that it is longer
 * than what is left, is what is left, and damaged. */
typedef struct {
    uint32_t code;
    const uint8_t *bytes;
    uint32_t length;
    bool is_damaged;
} bus_operation_t;

/* What an operation of a CAN frame says. Only data frames with an 11-bit identifier are carried. */
typedef enum { BUS_FRAME, BUS_OTHER_FRAME, BUS_NO_FRAME } bus_reading_t;

/* Reads the operation at *place and moves on behind it; false at the end. */
bool bus_next(const uint8_t **place, const uint8_t *end, bus_operation_t *operation);

/* Reads the frame of a CAN Transmit. */
bus_reading_t bus_read_frame(const bus_operation_t *operation, can_frame_t *frame);

/* Number of four bytes, or of one, behind the header of an operation that has them. */
uint32_t bus_number(const bus_operation_t *operation, uint32_t offset);
uint8_t bus_byte(const bus_operation_t *operation, uint32_t offset);

/* Operations on their way out. */
#define BUS_OUTGOING_BYTES 4096u
typedef struct {
    uint8_t bytes[BUS_OUTGOING_BYTES];
    uint32_t length;
} bus_outgoing_t;

/* Each appends one operation, or returns false where there is no room. */
bool bus_transmit(bus_outgoing_t *outgoing, const can_frame_t *frame);
bool bus_configure_baudrate(bus_outgoing_t *outgoing, uint32_t baudrate);
bool bus_configure_buffering(bus_outgoing_t *outgoing);
bool bus_tell_status(bus_outgoing_t *outgoing, uint8_t status);
bool bus_tell_format_error(bus_outgoing_t *outgoing, const bus_operation_t *wrong);

#endif
