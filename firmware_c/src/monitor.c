#include "monitor.h"

/* Lost or unreadable data stops at once and is forgiven when it returns within the debounce time.
 * Deviations need a few periods, because the charger answers one period after the command. */
const fault_policy_t MONITOR_POLICY[FAULT_COUNT] = {
    [FAULT_ELECTRICAL_MISSING] = { 3u, true, 0u },
    [FAULT_THERMAL_MISSING] = { 3u, true, 0u },
    [FAULT_COOLANT_MISSING] = { 3u, true, 0u },
    [FAULT_REQUEST_MISSING] = { 3u, true, 0u },
    [FAULT_CURRENT_RANGE] = { 3u, true, 3u },
    [FAULT_VOLTAGE_RANGE] = { 3u, true, 0u },
    [FAULT_SURFACE_RANGE] = { 3u, true, 0u },
    [FAULT_COOLANT_RANGE] = { 3u, true, 0u },
    [FAULT_COOLING_RANGE] = { 3u, true, 0u },
    [FAULT_REQUEST_INVALID] = { 3u, true, 0u },
    [FAULT_OUT_OF_DOMAIN] = { 5u, true, 5u },
    [FAULT_CURRENT_DEVIATION] = { 3u, false, 0u },
    [FAULT_VOLTAGE_DEVIATION] = { 5u, false, 0u },
    [FAULT_OVER_VOLTAGE] = { 2u, true, 3u },
    [FAULT_CORE_OVER_TEMPERATURE] = { 2u, true, 3u },
    [FAULT_SURFACE_OVER_TEMPERATURE] = { 2u, true, 3u },
    [FAULT_CORRUPTED_FRAMES] = { 3u, false, 5u },
    [FAULT_DECISION_INVALID] = { 2u, true, 0u },
    [FAULT_CALIBRATION] = { 1u, true, 0u },
    [FAULT_SURFACE_DEFICIT] = { 5u, true, 0u },
    [FAULT_OUT_OF_STEP] = { 1u, true, 0u },
};

void monitor_reset(monitor_t *monitor)
{
    for (uint32_t fault = 0u; fault < FAULT_COUNT; fault++) {
        monitor->lasted[fault] = 0u;
        monitor->returned[fault] = 0u;
    }
    monitor->counting = 0u;
    monitor->active = 0u;
    monitor->latched = 0u;
    monitor->first = FAULT_NONE;
    monitor->stop = false;
}

#define BIT(fault) ((uint32_t)1u << (uint32_t)(fault))

/* Those whose row says that they do not stop at once. */
#define GOES_ON \
    (BIT(FAULT_CURRENT_DEVIATION) | BIT(FAULT_VOLTAGE_DEVIATION) | BIT(FAULT_CORRUPTED_FRAMES))

bool monitor_stops(uint32_t symptoms)
{
    return (symptoms & ((BIT(FAULT_COUNT) - 1u) & ~GOES_ON)) != 0u;
}

static void latch(monitor_t *monitor, uint32_t fault)
{
    if (monitor->latched == 0u) {
        monitor->first = (uint8_t)fault;
    }
    monitor->latched |= BIT(fault);
}

/* Counts a symptom that begins anew; what has not come back for long is forgotten little by little,
 * so that it takes the same rate over any time. */
static void count_return(monitor_t *monitor, uint32_t fault)
{
    const uint32_t most = MONITOR_POLICY[fault].returns * (uint32_t)MONITOR_RETURN_PERIODS;
    const uint32_t sum = monitor->returned[fault] + (uint32_t)MONITOR_RETURN_PERIODS;
    if (most == 0u) {
        return;
    }
    monitor->returned[fault] = (uint16_t)((sum < most) ? sum : most);
    /* After the last of them the sum is above what one fewer can make. */
    if (sum > most - (uint32_t)MONITOR_RETURN_PERIODS) {
        latch(monitor, fault);
    }
}

static void count_period(monitor_t *monitor, uint32_t fault)
{
    if (monitor->lasted[fault] == 0u) {
        count_return(monitor, fault);
    }
    if (monitor->lasted[fault] < UINT8_MAX) {
        monitor->lasted[fault]++;
    }
    if (monitor->lasted[fault] >= MONITOR_POLICY[fault].debounce_periods) {
        latch(monitor, fault);
    }
}

void monitor_step(monitor_t *monitor, uint32_t symptoms)
{
    /* What is not seen and has nothing to forget stays as it is. */
    uint32_t moving = symptoms | monitor->counting;
    uint32_t counting = 0u;
    monitor->active = symptoms;
    monitor->stop = monitor_stops(symptoms);
    for (uint32_t fault = 0u; (fault < FAULT_COUNT) && (moving != 0u); fault++, moving >>= 1u) {
        if ((moving & 1u) == 0u) {
            continue;
        }
        if (monitor->returned[fault] > 0u) {
            monitor->returned[fault]--;
        }
        if ((symptoms & BIT(fault)) != 0u) {
            count_period(monitor, fault);
        } else {
            monitor->lasted[fault] = 0u;
        }
        if ((monitor->lasted[fault] != 0u) || (monitor->returned[fault] != 0u)) {
            counting |= BIT(fault);
        }
    }
    monitor->counting = counting;
}
