/* The ECU application: frames in, one step for each control period, frames out.
 *
 * There is no clock: time advances by one sampling period with every bms_step. All state is in a
 * bms_t of the caller.
 */
#ifndef BMS_H
#define BMS_H

#include <stdbool.h>
#include <stdint.h>

#include "calibration.h"
#include "can_frame.h"
#include "codec.h"
#include "family.h"
#include "history.h"
#include "kan.h"
#include "monitor.h"
#include "network.h"
#include "pace.h"
#include "planner.h"
#include "rcbf.h"
#include "soc.h"
#include "thermal.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BMS_FIRMWARE_VERSION 4
#define BMS_TRANSMITTED_MESSAGES 10

typedef enum {
    BMS_INIT = 0,
    BMS_STANDBY = 1,
    BMS_CHARGING = 2,
    BMS_DERATED = 3,
    BMS_COMPLETE = 4,
    BMS_FAULT = 5
} bms_state_t;

typedef struct {
    const bms_calibration_t *calibration; /* must outlive the bms_t */
} bms_config_t;

/* What a port knows of the start; all ones where it does not know. */
typedef struct {
    uint32_t calibration_content; /* first 32 bits of the SHA-256 of the calibration's bytes */
    uint8_t reset_cause;          /* ResetCause of the database */
    uint8_t reset_count;          /* starts in a row */
} bms_start_t;

typedef struct {
    const bms_calibration_t *calibration;
    bms_state_t state;
    uint32_t periods;
    bms_start_t start;
    codec_measurement_t measurement;
    network_t network;
    pace_t pace;
    bool has_started; /* all messages were valid once, or had the time to become so */
    bool may_start;   /* the request has been off since start-up or the last charge */
    uint16_t outside; /* bit n: the reading that fault n is about is implausible or none */
    soc_t soc;
    bool soc_known;
    uint8_t ocv_segment; /* of the table, where the last search ended */
    uint8_t decision_segment; /* and where that for the decision did */
    float open_circuit_voltage_V; /* of one cell's state of charge, where that is known */
    history_t history;
    thermal_t thermal;
    float coolant_temperature_K; /* last usable reading */
    float surface_temperature_K; /* measured, but no colder than the heat allows */
    family_t family;
    monitor_t monitor;
    kan_estimate_t estimate;
    planner_t planner;
    rcbf_decision_t decision;
    float command_A;
    float growth_A;       /* most that the command may grow by in the coming period */
    rcbf_active_t limit;  /* that kept it from growing freely, last */
    rcbf_steadier_t steadier;
    uint8_t counters[BMS_TRANSMITTED_MESSAGES];
    can_frame_t outbox[BMS_TRANSMITTED_MESSAGES];
    uint32_t outbox_length;
    uint32_t outbox_next;
} bms_t;

/* A missing or invalid calibration leads to the fault state, for good. */
void bms_init(bms_t *bms, const bms_config_t *config);

/* Between bms_init and the first step: what is said on the bus of the start. */
void bms_tell_start(bms_t *bms, const bms_start_t *start);

/* Takes any frame; foreign ones are ignored. */
void bms_receive(bms_t *bms, const can_frame_t *frame);

/* Runs one control period and replaces what is waiting to be sent. */
void bms_step(bms_t *bms);

/* Pops the next frame to send; the charge command is the last one of a period. */
bool bms_transmit(bms_t *bms, can_frame_t *frame);

#ifdef __cplusplus
}
#endif

#endif
