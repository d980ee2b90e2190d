/* Any symptoms in any state: stop at once, latch for good, first cause kept. */
#include "proof.h"

#include "monitor.h"

int main(void)
{
    ANY(monitor_t, monitor);
    ANY(uint32_t, symptoms);
    ANY(uint8_t, fault);
    GRANTED(fault < FAULT_COUNT);
    GRANTED(symptoms < ((uint32_t)1u << FAULT_COUNT));
    const uint32_t bit = (uint32_t)1u << fault;
    const monitor_t before = monitor;
    monitor_step(&monitor, symptoms);
    HOLDS((monitor.latched & before.latched) == before.latched, "nothing latched is lost");
    HOLDS(monitor.active == symptoms, "what is seen is told");
    HOLDS((before.latched == 0u) || (monitor.first == before.first), "the first cause stays");
    HOLDS((monitor.latched == before.latched) || ((monitor.latched & symptoms) != 0u),
          "nothing latches that is not seen");
    if ((symptoms & bit) != 0u) {
        HOLDS(!MONITOR_POLICY[fault].stops_at_once || monitor.stop, "what stops does so at once");
        HOLDS((before.lasted[fault] + 1u < MONITOR_POLICY[fault].debounce_periods) ||
                  ((monitor.latched & bit) != 0u),
              "what lasts as long as its row says latches");
    } else if ((symptoms | before.counting) & bit) {
        HOLDS(monitor.lasted[fault] == 0u, "what is not seen has not lasted");
    }
    return 0;
}
