/* Faults: which symptoms there are, how long each may last, and which stay until reset.
 *
 * A symptom that stops at once gives 0 A in the very period in which it is seen. A symptom that
 * lasts for its debounce time becomes a latched fault.
 */
#ifndef MONITOR_H
#define MONITOR_H

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    FAULT_ELECTRICAL_MISSING = 0,
    FAULT_THERMAL_MISSING = 1,
    FAULT_COOLANT_MISSING = 2,
    FAULT_REQUEST_MISSING = 3,
    FAULT_CURRENT_RANGE = 4,
    FAULT_VOLTAGE_RANGE = 5,
    FAULT_SURFACE_RANGE = 6,
    FAULT_COOLANT_RANGE = 7,
    FAULT_COOLING_RANGE = 8,
    FAULT_REQUEST_INVALID = 9,
    FAULT_OUT_OF_DOMAIN = 10,
    FAULT_CURRENT_DEVIATION = 11,
    FAULT_VOLTAGE_DEVIATION = 12,
    FAULT_OVER_VOLTAGE = 13,
    FAULT_CORE_OVER_TEMPERATURE = 14,
    FAULT_SURFACE_OVER_TEMPERATURE = 15,
    FAULT_CORRUPTED_FRAMES = 16,
    FAULT_DECISION_INVALID = 17,
    FAULT_CALIBRATION = 18,
    FAULT_SURFACE_DEFICIT = 19
} fault_t;

#define FAULT_COUNT 20
#define FAULT_NONE 255

typedef struct {
    uint8_t lasted[FAULT_COUNT]; /* periods without a break, saturating */
    uint32_t active;             /* bit n: symptom n seen in this period */
    uint32_t latched;            /* bit n: fault n stands until monitor_reset */
    uint8_t first;               /* fault that latched first, or FAULT_NONE */
    bool stop;                   /* a symptom of this period forbids current */
} monitor_t;

typedef struct {
    uint8_t debounce_periods; /* symptom in this many periods in a row latches the fault */
    bool stops_at_once;
} fault_policy_t;

extern const fault_policy_t MONITOR_POLICY[FAULT_COUNT];

void monitor_reset(monitor_t *monitor);

/* Takes the symptoms of one period, bit n for fault n. */
void monitor_step(monitor_t *monitor, uint32_t symptoms);

#endif
