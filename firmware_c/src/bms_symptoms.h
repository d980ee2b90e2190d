/* What the state of an ECU says of its readings, and what is wrong with them. */
#ifndef BMS_SYMPTOMS_H
#define BMS_SYMPTOMS_H

#include <math.h>

#include "bms.h"
#include "can_catalog.h"

static inline uint32_t bit_if(bool condition, fault_t fault)
{
    return condition ? ((uint32_t)1u << (uint32_t)fault) : 0u;
}

/* Of the latest readings, whether any of those that these faults are about is outside its range. */
static inline bool is_outside(const bms_t *bms, uint32_t faults)
{
    return (bms->outside & faults) != 0u;
}

#define OUTSIDE_CURRENT ((uint32_t)1u << (uint32_t)FAULT_CURRENT_RANGE)
#define OUTSIDE_VOLTAGE ((uint32_t)1u << (uint32_t)FAULT_VOLTAGE_RANGE)
#define OUTSIDE_SURFACE ((uint32_t)1u << (uint32_t)FAULT_SURFACE_RANGE)
#define OUTSIDE_COOLANT ((uint32_t)1u << (uint32_t)FAULT_COOLANT_RANGE)
#define OUTSIDE_COOLING ((uint32_t)1u << (uint32_t)FAULT_COOLING_RANGE)

static inline bool is_charging(const bms_t *bms)
{
    return (bms->state == BMS_CHARGING) || (bms->state == BMS_DERATED);
}

static inline bool is_usable(const bms_t *bms, uint32_t message)
{
    return bms->network.is_usable[message];
}

/* What a message said last still counts, though no frame came in this period. */
static inline bool is_valid(const bms_t *bms, uint32_t message)
{
    return bms->network.receivers[message].state == E2E_VALID;
}

static inline bool has_family(const bms_t *bms)
{
    return bms->calibration->family.is_stated != 0u;
}

/* What the readings say, and what is in force while they are taken. */
static inline family_reading_t reading_of(const bms_t *bms)
{
    const codec_measurement_t *m = &bms->measurement;
    return (family_reading_t){
        .current_A = m->current_A,
        .voltage_V = m->voltage_V,
        .surface_temperature_K = bms->surface_temperature_K,
        .coolant_temperature_K = m->coolant_temperature_K,
        .estimated_core_K = bms->estimate.in_domain ? bms->estimate.core_temperature_K : NAN,
        .command_A = bms->command_A,
        .is_usable = is_usable(bms, CAN_RECEIVED_CELL_ELECTRICAL) &&
                     is_usable(bms, CAN_RECEIVED_CELL_THERMAL) &&
                     !is_outside(bms, OUTSIDE_CURRENT | OUTSIDE_VOLTAGE | OUTSIDE_SURFACE |
                                          OUTSIDE_COOLANT),
        .is_charging = is_charging(bms),
    };
}

/* What bms_t.outside says of the latest readings. */
uint16_t bms_readings_outside(const bms_t *bms);

/* Bit n for fault n, of what this period's messages lack and of what their readings say. */
uint32_t bms_symptoms(const bms_t *bms);

#endif
