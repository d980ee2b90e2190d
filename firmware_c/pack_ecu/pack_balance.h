/* Passive balancing: which cells are bled through a resistor each, and by how much they have been.
 *
 * Only at rest, near the top, with every reading of the period there: the cells that are fuller than the
 * emptiest one, which itself is never bled. What has been bled is counted beside the core's own count,
 * which stays an upper bound whatever the resistors do; a charge begins anew with both.
 */
#ifndef PACK_BALANCE_H
#define PACK_BALANCE_H

#include "pack_ecu.h"

/* A charge has begun with what was bled until then. */
void pack_balance_begin(pack_ecu_t *ecu);

/* After the core's step of a period: who is bled until the next one. */
void pack_balance_step(pack_ecu_t *ecu);

/* Counted state of charge of the emptiest and the fullest cell, less what was bled. */
range_t pack_balance_spread(const pack_ecu_t *ecu);

#endif
