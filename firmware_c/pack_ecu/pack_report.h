/* What a pack's ECU says in a period. */
#ifndef PACK_REPORT_H
#define PACK_REPORT_H

#include "pack_ecu.h"

/* Fills the outbox: the pages that are next, then the messages that are due, the command last. */
void pack_report_queue(pack_ecu_t *ecu);

#endif
