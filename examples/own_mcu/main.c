/* Charges that hold their conditions for two seconds each: what the core estimates and decides. */
#include <math.h>
#include <stdio.h>

#include "control.h"

#define PERIODS 20
#define WANTED_A (-23.0f)

typedef struct {
    const char *name;
    float soc;
    control_readings_t readings; /* current_A: what flows when it begins */
} state_t;

static const state_t STATES[] = {
    { "cold and empty", 0.05f, { 0.0f, 3.2f, 0.23f, 283.0f, 282.0f } },
    { "warm", 0.40f, { -20.0f, 3.5f, 0.23f, 305.0f, 300.0f } },
    { "core near its limit", 0.50f, { -15.0f, 3.5f, 0.23f, 316.0f, 308.0f } },
    { "nearly full", 0.985f, { -6.0f, 3.5f, 0.23f, 305.0f, 300.0f } },
    { "unlike the training", 0.50f, { -15.0f, 3.5f, 0.23f, 316.0f, 274.0f } },
    { "broken sensor", 0.40f, { -20.0f, 3.5f, 0.23f, NAN, 300.0f } },
};

int main(void)
{
    for (unsigned i = 0; i < sizeof STATES / sizeof STATES[0]; i++) {
        control_t control;
        control_readings_t readings = STATES[i].readings;
        if (!control_begin(&control, &BMS_DEFAULT_CALIBRATION, STATES[i].soc)) {
            return 1;
        }
        control.command_A = readings.current_A;
        for (int period = 0; period < PERIODS; period++) {
            readings.current_A = control_step(&control, &readings, WANTED_A);
        }
        /* Nine digits tell every float32 apart, so that hosts and targets can be compared. */
        printf("%s: core %.9g K, soc %.9g, %.9g A, active %d, first fault %d\n", STATES[i].name,
               (double)control.estimate.core_temperature_K, (double)control.soc.soc,
               (double)control.command_A, (int)control.decision.active,
               (int)control.monitor.first);
    }
    return 0;
}
