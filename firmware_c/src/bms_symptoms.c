#include "bms_symptoms.h"

#include <math.h>

#include "numeric.h"
#include "request.h"

static uint32_t symptoms_of_missing_messages(const bms_t *bms)
{
    static const fault_t MISSING[CAN_RECEIVED_COUNT] = {
        [CAN_RECEIVED_CELL_ELECTRICAL] = FAULT_ELECTRICAL_MISSING,
        [CAN_RECEIVED_CELL_THERMAL] = FAULT_THERMAL_MISSING,
        [CAN_RECEIVED_COOLANT] = FAULT_COOLANT_MISSING,
        [CAN_RECEIVED_CHARGE_REQUEST] = FAULT_REQUEST_MISSING,
    };
    uint32_t symptoms = bit_if(bms->network.is_disturbed, FAULT_CORRUPTED_FRAMES) |
                        bit_if(pace_is_lost(&bms->pace), FAULT_OUT_OF_STEP);
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        symptoms |= bit_if(!CAN_RECEIVED[i].is_optional && !is_usable(bms, i), MISSING[i]);
    }
    return symptoms;
}

NUMERIC_APART uint32_t outside_if(float value, const range_t *range, uint32_t fault)
{
    return ((value >= range->low) && (value <= range->high)) ? 0u : fault;
}

uint16_t bms_readings_outside(const bms_t *bms)
{
    const codec_measurement_t *m = &bms->measurement;
    const plausibility_t *limits = &bms->calibration->plausibility;
    return (uint16_t)(
        outside_if(m->current_A, &limits->current_A, OUTSIDE_CURRENT) |
        outside_if(m->voltage_V, &limits->voltage_V, OUTSIDE_VOLTAGE) |
        outside_if(m->surface_temperature_K, &limits->surface_temperature_K, OUTSIDE_SURFACE) |
        outside_if(m->coolant_temperature_K, &limits->coolant_temperature_K, OUTSIDE_COOLANT) |
        outside_if(m->cooling_power_W, &limits->cooling_power_W, OUTSIDE_COOLING));
}

static bool current_deviates(const bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    const float current_A = bms->measurement.current_A;
    const float deviation_A = calibration->plausibility.current_deviation_A;
    if (has_family(bms)) {
        return !family_supply_is_plausible(&bms->family, &calibration->family, current_A,
                                           deviation_A);
    }
    return fabsf(current_A - bms->command_A) > deviation_A;
}

static bool voltage_deviates(const bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    const codec_measurement_t *m = &bms->measurement;
    const rcbf_constants_t *cell = &calibration->rcbf;
    const float deviation_V = calibration->plausibility.voltage_deviation_V;
    if (has_family(bms)) {
        const family_reading_t reading = reading_of(bms);
        return !family_voltage_is_plausible(&bms->family, &calibration->family, cell, &reading,
                                            deviation_V);
    }
    const float model_V =
        bms->open_circuit_voltage_V - m->current_A * cell->ohmic_resistance_ohm;
    return fabsf(m->voltage_V - model_V) > deviation_V;
}

static bool core_is_too_hot(const bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    const float overshoot_K = calibration->plausibility.temperature_overshoot_K;
    if (has_family(bms)) {
        /* A cell that comes hot from a drive waits at 0 A; one that is charged all the same does
         * not do what it is told. */
        const family_reading_t reading = reading_of(bms);
        return is_charging(bms) &&
               family_is_too_hot(&bms->family, &calibration->family, &calibration->rcbf, &reading,
                                 overshoot_K);
    }
    const rcbf_constants_t *cell = &calibration->rcbf;
    return bms->estimate.core_temperature_K > cell->max_core_temperature_K.high_K +
                                                  cell->estimation_error_bound_K + overshoot_K;
}

/* Whether the decision relies on an estimate that training has not seen. */
static bool is_out_of_domain(const bms_t *bms)
{
    return !bms->estimate.in_domain && !has_family(bms);
}

static uint32_t symptoms_of_readings(const bms_t *bms)
{
    const codec_measurement_t *m = &bms->measurement;
    const plausibility_t *limits = &bms->calibration->plausibility;
    const rcbf_constants_t *cell = &bms->calibration->rcbf;
    const bool electrical = is_usable(bms, CAN_RECEIVED_CELL_ELECTRICAL);
    const bool thermal = is_usable(bms, CAN_RECEIVED_CELL_THERMAL);
    const bool coolant = is_usable(bms, CAN_RECEIVED_COOLANT);
    const float surface_limit_K =
        cell->max_surface_temperature_K.high_K + limits->temperature_overshoot_K;
    const float coldest_surface_K =
        thermal_coldest_surface_K(&bms->thermal, &bms->calibration->thermal);

    const uint32_t told = (electrical ? (OUTSIDE_CURRENT | OUTSIDE_VOLTAGE) : 0u) |
                          (thermal ? (OUTSIDE_SURFACE | OUTSIDE_COOLANT) : 0u) |
                          (coolant ? OUTSIDE_COOLING : 0u);

    return (bms->outside & told) |
           bit_if(is_usable(bms, CAN_RECEIVED_CHARGE_REQUEST) &&
                      !request_is_valid(m, is_valid(bms, CAN_RECEIVED_CHARGE_MODE),
                                        cell->max_soc),
                  FAULT_REQUEST_INVALID) |
           bit_if(electrical && thermal && coolant && is_out_of_domain(bms),
                  FAULT_OUT_OF_DOMAIN) |
           bit_if(electrical && current_deviates(bms), FAULT_CURRENT_DEVIATION) |
           bit_if(electrical && bms->soc_known && voltage_deviates(bms),
                  FAULT_VOLTAGE_DEVIATION) |
           bit_if(electrical &&
                      (m->voltage_V > cell->max_voltage_V + limits->voltage_overshoot_V),
                  FAULT_OVER_VOLTAGE) |
           bit_if(thermal && core_is_too_hot(bms), FAULT_CORE_OVER_TEMPERATURE) |
           bit_if(thermal && (m->surface_temperature_K > surface_limit_K),
                  FAULT_SURFACE_OVER_TEMPERATURE) |
           bit_if(thermal && (coldest_surface_K - m->surface_temperature_K >
                              limits->surface_deficit_K),
                  FAULT_SURFACE_DEFICIT);
}

uint32_t bms_symptoms(const bms_t *bms)
{
    return symptoms_of_missing_messages(bms) | symptoms_of_readings(bms);
}
