/* One charge of one cell by estimate and decision of the core, in an application of one's own. */
#ifndef CONTROL_H
#define CONTROL_H

#include "calibration.h"
#include "history.h"
#include "monitor.h"
#include "soc.h"

/* What the application's drivers measure at the start of a control period; NaN where they fail. */
typedef struct {
    float current_A; /* negative while charging */
    float voltage_V;
    float cooling_power_W;
    float surface_temperature_K;
    float coolant_temperature_K;
} control_readings_t;

typedef struct {
    const bms_calibration_t *calibration;
    soc_t soc;
    history_t history;
    monitor_t monitor;
    kan_estimate_t estimate;
    rcbf_decision_t decision;
    float command_A;
} control_t;

/* Begins a charge at a known state of charge; false when the calibration is not usable. */
bool control_begin(control_t *control, const bms_calibration_t *calibration, float soc);

/* Current in A for the charger until the next call, one sampling period later; 0 A in doubt. */
float control_step(control_t *control, const control_readings_t *readings, float wanted_A);

#endif
