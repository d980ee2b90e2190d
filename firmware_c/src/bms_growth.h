/* How fast the current of a charge may change. */
#ifndef BMS_GROWTH_H
#define BMS_GROWTH_H

#include "bms.h"

/* What is asked for, within the preset's strongest current and the growth of one period. To a weaker
 * plan the current falls gradually, to a weaker request at once. The weaker of two charging currents
 * is the greater number. */
float bms_wanted_current_A(const bms_t *bms);

/* Takes a decision that is about to be the command. A charge begins with the preset's growth, until it
 * has come to what was asked for; then no step is larger than somebody would notice.
 *
 * What a limit allows jitters with the noise of the readings. The current obeys each fall at once,
 * and so stays on the lower side of that jitter if it rises slowly: where a limit was met it begins
 * anew with a small growth, and grows faster the longer none is. Until then that limit is the one
 * that holds it back. */
void bms_follow_growth(bms_t *bms);

#endif
