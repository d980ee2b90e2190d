/* What a pack's ECU makes of the frames that come: content, protection and age of every page. */
#ifndef PACK_NETWORK_H
#define PACK_NETWORK_H

#include "pack_ecu.h"

void pack_network_receive(pack_ecu_t *ecu, const can_frame_t *frame);

/* Ends a period: judges every message and page. Readings without a usable page become NaN. */
void pack_network_step(pack_ecu_t *ecu);

/* States of charge at plug-in are no numbers until each page has come anew. */
void pack_network_forget_plug_in(pack_ecu_t *ecu);

/* Whether all that has to come every period has done so often enough to be trusted. */
bool pack_network_is_valid(const pack_ecu_t *ecu);

/* Bit n for fault n, of what is wrong with the messages of a period, or between two of them. */
uint32_t pack_network_symptoms(const pack_ecu_t *ecu);

#endif
