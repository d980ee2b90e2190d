/* Faults: which symptoms there are, how long each may last, and which stay until reset.
 *
 * A symptom that stops at once gives 0 A in the very period in which it is seen. A symptom that
 * lasts for its debounce time becomes a latched fault, and so does one that the stop removes as often
 * as it comes back.
 */
#ifndef MONITOR_H
#define MONITOR_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FAULT_ELECTRICAL_MISSING = 0, /* no usable CellElectrical message */
    FAULT_THERMAL_MISSING = 1, /* no usable CellThermal message */
    FAULT_COOLANT_MISSING = 2, /* no usable Coolant message */
    FAULT_REQUEST_MISSING = 3, /* no usable ChargeRequest message */
    FAULT_CURRENT_RANGE = 4, /* current implausible or not available */
    FAULT_VOLTAGE_RANGE = 5, /* voltage implausible or not available */
    FAULT_SURFACE_RANGE = 6, /* surface temperature implausible or not available */
    FAULT_COOLANT_RANGE = 7, /* coolant temperature implausible or not available */
    FAULT_COOLING_RANGE = 8, /* cooling power implausible or not available */
    FAULT_REQUEST_INVALID = 9, /* unknown request, or its numbers make no charge */
    FAULT_OUT_OF_DOMAIN = 10, /* inputs outside of what the estimator was trained on */
    FAULT_CURRENT_DEVIATION = 11, /* current is not the one commanded */
    FAULT_VOLTAGE_DEVIATION = 12, /* voltage does not fit state of charge and current */
    FAULT_OVER_VOLTAGE = 13, /* voltage above its limit */
    FAULT_CORE_OVER_TEMPERATURE = 14, /* core estimate above its limit */
    FAULT_SURFACE_OVER_TEMPERATURE = 15, /* surface temperature above its limit */
    FAULT_CORRUPTED_FRAMES = 16, /* frames refused by the end-to-end check */
    FAULT_DECISION_INVALID = 17, /* the decision is not a number */
    FAULT_CALIBRATION = 18, /* calibration missing or damaged */
    FAULT_SURFACE_DEFICIT = 19, /* surface reads colder than the heat allows */
    FAULT_OUT_OF_STEP = 20 /* control periods are longer than those of the measurements */
} fault_t;

#define FAULT_COUNT 21
#define FAULT_NONE 255

typedef struct {
    uint8_t lasted[FAULT_COUNT];    /* periods without a break, saturating */
    uint16_t returned[FAULT_COUNT]; /* MONITOR_RETURN_PERIODS a time, less those since */
    uint32_t counting;           /* bit n: a count of fault n above is not 0 */
    uint32_t active;             /* bit n: symptom n seen in this period */
    uint32_t latched;            /* bit n: fault n stands until monitor_reset */
    uint8_t first;               /* fault that latched first, or FAULT_NONE */
    bool stop;                   /* a symptom of this period forbids current */
} monitor_t;

typedef struct {
    uint8_t debounce_periods; /* symptom in this many periods in a row latches the fault */
    bool stops_at_once;
    uint8_t returns; /* times within MONITOR_RETURN_PERIODS, or as often over longer, that latch the
                        fault as well; 0 for a symptom that may come and go */
} fault_policy_t;

#define MONITOR_RETURN_PERIODS 600

extern const fault_policy_t MONITOR_POLICY[FAULT_COUNT];

void monitor_reset(monitor_t *monitor);

/* Whether any of these symptoms, bit n for fault n, forbids current in its own period. */
bool monitor_stops(uint32_t symptoms);

/* Takes the symptoms of one period, bit n for fault n. */
void monitor_step(monitor_t *monitor, uint32_t symptoms);

#ifdef __cplusplus
}
#endif

#endif
