/* The ECU of a pack: frames in, one step of the pack's core for each control period, frames out.
 *
 * Every page of three cells is a message of its own: one that does not come, or not intact, leaves its
 * cells without readings, and the pack without current. All state is in the caller's pack_ecu_t; there
 * is no allocation and no clock.
 */
#ifndef PACK_ECU_H
#define PACK_ECU_H

#include <stdbool.h>
#include <stdint.h>

#include "can_frame.h"
#include "e2e.h"
#include "monitor.h"
#include "pace.h"
#include "pack.h"
#include "pack_catalog.h"
#include "pack_function.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Groups that come every period, at the beginning of those of the catalogue; then those in turn. */
#define PACK_ECU_SUPERVISED 2
#define PACK_ECU_RECEIVED 3
#define PACK_ECU_SENT 3

#define PACK_ECU_MESSAGES 3
#define PACK_ECU_OUTBOX 16 /* holds all messages and the pages of a period */

/* In place of a cell's number on the bus, where they count from 1: none. */
#define PACK_ECU_NO_CELL 0

/* All zero for a pack without bleed resistors. */
typedef struct {
    float resistor_ohm; /* of each cell */
    float least_soc;    /* below which no cell is bled */
    float least_gap;    /* in state of charge, above the emptiest cell, from which on a cell is */
} pack_balance_t;

typedef struct {
    pack_config_t pack;
    float pack_voltage_error_V; /* of the sum of the cells' voltages against that of the pack */
    pack_horizon_t now;         /* until the next command acts */
    pack_horizon_t soon;        /* for 10 s */
    pack_balance_t balance;
} pack_ecu_config_t;

typedef struct {
    pack_t pack;
    uint32_t periods;
    float pack_voltage_error_V;
    pack_horizon_t now;
    pack_horizon_t soon;
    pack_balance_t balance;
    float current_A; /* what came last of each signal; NaN where its sender has no value */
    float pack_voltage_V;
    float coolant_in_K;
    float coolant_out_K;
    float cooling_power_W;
    float reference_current_A;
    uint8_t request;
    uint8_t cells_in_series;
    float voltage_V[BMS_MAX_CELLS];
    float surface_temperature_K[BMS_MAX_CELLS]; /* of each thermistor */
    float plug_in_soc[BMS_MAX_CELLS];
    e2e_receiver_t receiver[PACK_ECU_MESSAGES];
    bool is_usable[PACK_ECU_MESSAGES];
    e2e_receiver_t page[PACK_ECU_RECEIVED][(BMS_MAX_CELLS + 2) / 3];
    /* By how much a counter is ahead of PackElectrical's, since before the charge. */
    uint8_t message_phase[PACK_ECU_MESSAGES];
    uint8_t phase[PACK_ECU_SUPERVISED][(BMS_MAX_CELLS + 2) / 3];
    uint8_t plug_in_age[(BMS_MAX_CELLS + 2) / 3]; /* in periods */
    bool is_disturbed; /* a frame of this period was refused, or is of cells that are not there */
    bool is_page_missing[PACK_ECU_SUPERVISED]; /* in this period, by group */
    uint8_t missing_cell; /* first one without a page in this period, or PACK_NO_CELL */
    pace_t pace;
    uint8_t measured_periods; /* since the last step, by the counter of PackElectrical */
    bool has_started; /* all messages were valid once, or had the time to become so */
    bool is_asked;    /* for a charge: no usable request since has said off */
    monitor_t monitor;       /* of the network's faults; the core has one for the rest */
    uint32_t latched_faults; /* of both, until the request goes off */
    uint8_t first_fault;
    float command_A;
    float allowed_now_A; /* state of function */
    float allowed_soon_A;
    uint8_t bleeds[BMS_MAX_CELLS]; /* 1 for a cell that is bled */
    float bled_soc[BMS_MAX_CELLS]; /* since the last charge */
    uint8_t turn[PACK_ECU_SENT]; /* page that is next to be sent */
    uint8_t page_counter[PACK_ECU_SENT][(BMS_MAX_CELLS + 2) / 3];
    uint8_t counter[PACK_TRANSMITTED_COUNT];
    can_frame_t outbox[PACK_ECU_OUTBOX];
    uint32_t outbox_length;
    uint32_t outbox_next;
} pack_ecu_t;

/* A configuration that pack_init refuses leads to the fault state, for good. */
void pack_ecu_init(pack_ecu_t *ecu, const pack_ecu_config_t *config);

/* Takes any frame; foreign ones are ignored. */
void pack_ecu_receive(pack_ecu_t *ecu, const can_frame_t *frame);

/* Runs one control period and replaces what is waiting to be sent. */
void pack_ecu_step(pack_ecu_t *ecu);

/* Pops the next frame to send; the command is the last one of a period. */
bool pack_ecu_transmit(pack_ecu_t *ecu, can_frame_t *frame);

#ifdef __cplusplus
}
#endif

#endif
