/* The plant's and the charger's end of a pack's bus: readings to protected frames, answers to values. */
#ifndef PACK_WIRE_H
#define PACK_WIRE_H

#include "pack_charge.h"
#include "pack_ecu.h"

/* Frames of a period, beside SYNC, are no more than this many. */
#define PACK_WIRE_MOST 210

/* What the charger asks for. */
typedef struct {
    uint8_t request; /* codec_request_t */
    uint8_t cells;   /* that the charger takes the pack to have */
    float reference_current_A;
    const float *plug_in_soc; /* of each cell */
} pack_asked_t;

/* Counters of what is sent and state of what is received; all zero at the start. */
typedef struct {
    uint8_t counter[PACK_ECU_MESSAGES];
    uint8_t page_counter[PACK_ECU_RECEIVED][(BMS_MAX_CELLS + 2) / 3];
    uint32_t turn; /* page of the states of charge that is next */
    e2e_receiver_t command;
    e2e_receiver_t bleed_page[(BMS_MAX_CELLS + 2) / 3];
    uint8_t bleed_age[(BMS_MAX_CELLS + 2) / 3]; /* in periods since a page could be obeyed */
} pack_wire_t;

/* What the ECU said; NaN, and all ones, where it has not said it or has no value. */
typedef struct {
    float command_A; /* that may be obeyed: intact, in sequence, of a valid message, uncontested */
    bool is_contested;
    uint8_t state;
    uint8_t weakest_cell;
    uint8_t governing_cell; /* from 1; 0 for none */
    uint8_t constraint;
    uint8_t feasible;
    uint8_t first_fault;
    uint8_t faulty_cell;
    uint8_t cells;
    uint8_t network_version;
    float weakest_core_K;
    float weakest_soc;
    float limit_A;
    float allowed_now_A;
    float allowed_soon_A; /* for 10 s */
    float highest_soc;
    float lowest_soc;
    uint32_t active_faults;
    uint32_t latched_faults;
    uint32_t model_hash;
    uint32_t preset_hash;
    float core_K[BMS_MAX_CELLS]; /* as it came last of each cell */
    float soc[BMS_MAX_CELLS];
    bool bleeds[BMS_MAX_CELLS]; /* that may be obeyed */
} pack_heard_t;

/* Fills the frames of a period, without SYNC, and returns how many they are. */
uint32_t pack_wire_publish(pack_wire_t *wire, const pack_measured_t *measured, float pack_voltage_V,
                           uint32_t thermistors, const pack_asked_t *asked, can_frame_t *frames);

/* Takes the frames of a period's answer. Of several commands in one none is obeyed. */
void pack_wire_hear(pack_wire_t *wire, const can_frame_t *frames, uint32_t count,
                    pack_heard_t *heard);

/* Periods for which a page of bleeds that does not come again holds. */
#define PACK_BLEED_PERIODS 100

/* Switches the resistors of a plant as was heard. */
void pack_wire_bleed(const pack_heard_t *heard, plant_t *plant);

/* Identifier of what an ECU's step ends with. */
uint32_t pack_command_id(void);

/* A period of an ECU by one call; returns how many frames it sends. */
uint32_t pack_wire_exchange(pack_ecu_t *ecu, const can_frame_t *frames, uint32_t count,
                            can_frame_t *sent);

#endif
