/* One cell of a pack in one period: what is known of it, and the currents that it admits. */
#ifndef PACK_CELL_H
#define PACK_CELL_H

#include <math.h>

#include "pack.h"

/* A pack whose current is no more than this is at rest. */
#define PACK_REST_A 0.1f

/* What the readings of a period are to one cell. */
typedef struct {
    float current_A;
    float voltage_V;
    float surface_temperature_K;
    float coolant_temperature_K;
    float kept_coolant_K; /* the last usable one */
    float cooling_power_W;
    bool is_surface_usable;
    bool is_coolant_usable;
    uint32_t outside; /* bit n: the reading that fault n is about is implausible or none */
} pack_cell_reading_t;

static inline uint32_t pack_bit_if(bool condition, fault_t fault)
{
    return condition ? ((uint32_t)1u << (uint32_t)fault) : 0u;
}

static inline bool pack_has_family(const pack_t *pack)
{
    return pack->calibration->family.is_stated != 0u;
}

static inline bool pack_is_charging(const pack_t *pack)
{
    return (pack->state == BMS_CHARGING) || (pack->state == BMS_DERATED);
}

static inline bool pack_is_bare(const pack_cell_t *cell)
{
    return cell->thermistor == PACK_NO_THERMISTOR;
}

pack_cell_reading_t pack_cell_reading(const pack_t *pack, const pack_readings_t *readings,
                                      uint32_t index);

/* The same as its family's observer takes it. */
family_reading_t pack_family_reading(const pack_t *pack, const pack_cell_reading_t *reading,
                                     uint32_t index);

/* Takes the readings into what is known of a cell. The start is the temperature of a cell without a
 * thermistor at the first readings. */
void pack_cell_update(pack_t *pack, uint32_t index, const pack_cell_reading_t *reading,
                      float start_K);

/* Begins a charge at the state of charge that is told, or that was counted since the charge before
 * less what was bled, where that is more: what is told may be of the past. */
void pack_cell_begin(pack_t *pack, const pack_readings_t *readings, uint32_t index);

bool pack_cell_is_full(const pack_t *pack, uint32_t index);

/* Nearest to the reference of the currents that a cell admits. The segment and the steadier are
 * those of the cell, or copies. */
rcbf_decision_t pack_cell_decide(const pack_t *pack, uint32_t index,
                                 const pack_cell_reading_t *reading, float reference_current_A,
                                 uint8_t *segment, rcbf_steadier_t *steadier);

/* Bit n for fault n, of what is wrong with a cell's readings. */
uint32_t pack_cell_symptoms(const pack_t *pack, uint32_t index,
                            const pack_cell_reading_t *reading);

#endif
