/* How a charge is planned, where a charger asks for that. */
#ifndef BMS_PLAN_H
#define BMS_PLAN_H

#include "bms.h"

/* Whether the optional message asks for a charge that is planned: Fastest or ByTime. */
bool bms_has_planned_mode(const bms_t *bms);

/* Lets the planner work for one period of a charge; without one, or without such a mode, there is
 * no plan. */
void bms_plan(bms_t *bms);

#endif
