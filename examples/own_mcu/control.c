#include "control.h"

static uint32_t symptom_if(bool is_seen, fault_t fault)
{
    return is_seen ? ((uint32_t)1u << (uint32_t)fault) : 0u;
}

static bool is_outside(float value, range_t range)
{
    return !((value >= range.low) && (value <= range.high)); /* true for NaN */
}

static uint32_t symptoms_of(const bms_calibration_t *cell, const control_readings_t *now)
{
    const plausibility_t *limits = &cell->plausibility;
    const float over_voltage_V = cell->rcbf.max_voltage_V + limits->voltage_overshoot_V;
    return symptom_if(is_outside(now->current_A, limits->current_A), FAULT_CURRENT_RANGE) |
           symptom_if(is_outside(now->voltage_V, limits->voltage_V), FAULT_VOLTAGE_RANGE) |
           symptom_if(now->voltage_V > over_voltage_V, FAULT_OVER_VOLTAGE) |
           symptom_if(is_outside(now->cooling_power_W, limits->cooling_power_W),
                      FAULT_COOLING_RANGE) |
           symptom_if(is_outside(now->surface_temperature_K, limits->surface_temperature_K),
                      FAULT_SURFACE_RANGE) |
           symptom_if(is_outside(now->coolant_temperature_K, limits->coolant_temperature_K),
                      FAULT_COOLANT_RANGE);
}

bool control_begin(control_t *control, const bms_calibration_t *calibration, float soc)
{
    *control = (control_t){ .calibration = calibration };
    soc_set(&control->soc, soc);
    monitor_reset(&control->monitor);
    return calibration_is_valid(calibration) && (soc >= 0.0f) && (soc <= calibration->rcbf.max_soc);
}

float control_step(control_t *control, const control_readings_t *now, float wanted_A)
{
    const bms_calibration_t *cell = control->calibration;
    uint32_t symptoms = symptoms_of(cell, now);
    const bool is_usable = !monitor_stops(symptoms);
    const float flowed_A = is_usable ? now->current_A : control->command_A;
    soc_count(&control->soc, flowed_A, control->command_A, cell->sampling_period_s,
              cell->rcbf.capacity_As);

    const float inputs[KAN_MEASURED_INPUTS] = { now->current_A, now->cooling_power_W,
                                                now->surface_temperature_K,
                                                now->coolant_temperature_K };
    history_step(&control->history, &cell->kan, flowed_A, now->surface_temperature_K, is_usable);
    control->estimate = history_estimate(&control->history, &cell->kan, inputs);
    symptoms |= symptom_if(is_usable && !control->estimate.in_domain, FAULT_OUT_OF_DOMAIN);

    /* Of two charging currents the weaker is the greater number. */
    const float strongest_A = cell->reference_current_A;
    const float grown_A = control->command_A - cell->current_growth_A;
    const float allowed_A = (grown_A < strongest_A) ? strongest_A : grown_A;
    const rcbf_input_t input = {
        .core_temperature_K = { .high_K = control->estimate.core_temperature_K },
        .surface_temperature_K = { .high_K = now->surface_temperature_K },
        .coolant_temperature_K = { .high_K = now->coolant_temperature_K },
        .cooling_power_W = now->cooling_power_W,
        .soc = control->soc.soc + cell->soc_error,
        .reference_current_A = (wanted_A < allowed_A) ? allowed_A : wanted_A,
    };
    control->decision = rcbf_solve(&cell->rcbf, &input);
    monitor_step(&control->monitor, symptoms);
    const bool may_charge = !control->monitor.stop && (control->monitor.latched == 0u) &&
                            control->decision.feasible &&
                            (control->soc.soc < cell->completion_soc);
    control->command_A = may_charge ? control->decision.current_A : 0.0f;
    return control->command_A;
}
