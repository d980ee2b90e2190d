/* Between frames and physical values: layout by the generated database, range by this layer.
 *
 * A value that a signal cannot hold saturates; one that is not finite is sent as "not available"
 * (all ones), and a received raw value above the signal's range is not available either.
 */
#ifndef CODEC_H
#define CODEC_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "e2e.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float scale;
    int32_t offset_steps; /* of the value, in steps of the scale */
    uint32_t raw_max; /* largest raw value that carries a number; two codes stay above it */
} codec_signal_t;

typedef struct {
    uint32_t id;
    uint8_t length;
    uint8_t is_protected;
    uint8_t is_optional;
    uint8_t every_periods;
    e2e_policy_t policy;
    uint8_t data_ids[E2E_COUNTERS];
} codec_message_t;

typedef enum { CODEC_NEAREST, CODEC_TOWARDS_ZERO } codec_rounding_t;

uint32_t codec_encode(const codec_signal_t *signal, float value, codec_rounding_t rounding);

/* The value, or NaN when it is not available. */
float codec_decode(const codec_signal_t *signal, uint32_t raw);

typedef enum { REQUEST_OFF = 0, REQUEST_CHARGE = 1 } codec_request_t;
typedef enum { MODE_FASTEST = 0, MODE_BY_TIME = 1, MODE_FIXED = 2 } codec_mode_t;
typedef enum { FAULT_PAGE_ACTIVE = 0, FAULT_PAGE_LATCHED = 1 } codec_fault_page_t;

/* Faults of the message Diagnostics; the later ones are in Diagnostics2. */
#define CODEC_FIRST_FAULTS 20u

/* Latest content of the received messages; NaN where a sender has no value. */
typedef struct {
    float current_A;
    float voltage_V;
    float surface_temperature_K;
    float coolant_temperature_K;
    float cooling_power_W;
    uint8_t request; /* codec_request_t; anything else is invalid */
    float reference_current_A;
    float plug_in_soc;
    uint8_t mode; /* codec_mode_t; anything else is invalid */
    float time_to_full_s;
} codec_measurement_t;

/* What the application reports each period. */
typedef struct {
    float command_A;
    float core_temperature_K;
    float soc;
    float error_bound_K;
    uint8_t in_domain;
    uint8_t active_constraint;
    uint8_t feasible;
    uint8_t first_fault;
    float lower_A;
    float upper_A;
    float margins[4];
    uint32_t active_faults;
    uint32_t latched_faults;
    uint8_t fault_page; /* codec_fault_page_t */
    uint8_t reported_message; /* order of CAN_RECEIVED */
    uint8_t reported_state;   /* e2e_state_t */
    e2e_counts_t reported_counts;
    uint32_t model_hash;
    uint16_t preset_hash;
    uint8_t firmware_version;
    uint32_t calibration_content;
    uint8_t reset_cause;
    uint8_t reset_count;
    uint8_t state;
    float planned_A;                /* NaN without a plan, as is the next one */
    float predicted_time_to_full_s;
} codec_report_t;

/* Reads received message `index` (order of CAN_RECEIVED); the length must have been checked. */
void codec_read(uint32_t index, const uint8_t *data, codec_measurement_t *measurement);

/* Fills transmitted message `index` (order of CAN_TRANSMITTED), without its protection. */
void codec_write(uint32_t index, const codec_report_t *report, can_frame_t *frame);

#ifdef __cplusplus
}
#endif

#endif
