/* Time as the sender of the measurements counts it, held against the control periods.
 *
 * A step takes one sampling period for granted: state of charge, filters and margins count on it.
 * What makes an ECU step, a clock or a SYNC frame that anybody can send, does not prove it. The
 * counter of a protected message does, because its sender measures once a period.
 */
#ifndef PACE_H
#define PACE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Periods of the sender beyond those of the ECU that may be. */
#define PACE_ALLOWED_PERIODS 10
/* What a period takes back of that, so that clocks may differ by as much: 1 of 128. */
#define PACE_FORGOTTEN_PERIODS 128

/* In 1 / PACE_FORGOTTEN_PERIODS of a period; all zero at the start of a charge. */
typedef struct {
    int32_t ahead;
} pace_t;

/* Ends a control period in which the sender's counter has moved by so many. */
void pace_step(pace_t *pace, uint8_t measured_periods);

/* Whether steps are so much rarer than measurements that they do not last one period. */
bool pace_is_lost(const pace_t *pace);

#ifdef __cplusplus
}
#endif

#endif
