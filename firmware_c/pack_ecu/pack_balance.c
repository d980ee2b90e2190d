#include "pack_balance.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

#include "numeric.h"
#include "pack_cell.h"

static float soc_of(const pack_ecu_t *ecu, uint32_t cell)
{
    return ecu->pack.cell[cell].soc.soc - ecu->bled_soc[cell];
}

range_t pack_balance_spread(const pack_ecu_t *ecu)
{
    range_t spread = { FLT_MAX, -FLT_MAX };
    for (uint32_t i = 0u; i < ecu->pack.cells; i++) {
        spread.low = numeric_smaller(spread.low, soc_of(ecu, i));
        spread.high = numeric_larger(spread.high, soc_of(ecu, i));
    }
    return spread;
}

/* Constants that are not set, or no numbers, forbid it. */
static bool is_possible(const pack_balance_t *balance)
{
    return numeric_is_within(balance->resistor_ohm, FLT_MIN, FLT_MAX) &&
           numeric_is_within(balance->least_soc, 0.0f, 1.0f) &&
           numeric_is_within(balance->least_gap, FLT_MIN, 1.0f);
}

static bool may_bleed(const pack_ecu_t *ecu)
{
    const pack_t *pack = &ecu->pack;
    const uint32_t symptoms = ecu->monitor.active | ecu->monitor.latched | pack->monitor.active |
                              pack->monitor.latched;
    return is_possible(&ecu->balance) && ecu->has_started && (pack->calibration != NULL) &&
           pack->soc_known && (symptoms == 0u) && (ecu->command_A == 0.0f) &&
           (fabsf(ecu->current_A) <= PACK_REST_A) &&
           ((pack->state == BMS_STANDBY) || (pack->state == BMS_COMPLETE));
}

/* A cell that is bled goes on until it is as empty as the emptiest; one that is not waits until there
 * is a gap that is worth it. */
static bool is_to_bleed(const pack_ecu_t *ecu, uint32_t cell, float lowest_soc)
{
    const float soc = soc_of(ecu, cell);
    const float least_gap = (ecu->bleeds[cell] != 0u) ? 0.0f : ecu->balance.least_gap;
    return (soc >= ecu->balance.least_soc) && (soc - lowest_soc > least_gap);
}

static void bleed_none(pack_ecu_t *ecu)
{
    for (uint32_t i = 0u; i < ecu->pack.cells; i++) {
        ecu->bleeds[i] = 0u;
    }
}

void pack_balance_begin(pack_ecu_t *ecu)
{
    for (uint32_t i = 0u; i < ecu->pack.cells; i++) {
        ecu->bled_soc[i] = 0.0f;
    }
}

void pack_balance_step(pack_ecu_t *ecu)
{
    const pack_t *pack = &ecu->pack;
    if (!may_bleed(ecu)) {
        bleed_none(ecu);
        return;
    }
    const float lowest_soc = pack_balance_spread(ecu).low;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        ecu->bleeds[i] = is_to_bleed(ecu, i, lowest_soc) ? 1u : 0u;
        if (ecu->bleeds[i] != 0u) {
            ecu->bled_soc[i] += ecu->voltage_V[i] / ecu->balance.resistor_ohm *
                                pack->calibration->sampling_period_s /
                                pack->calibration->rcbf.capacity_As;
        }
    }
}
