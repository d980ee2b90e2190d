/* What a cell's readings say of themselves: as bms_symptoms.c has it for one cell, without what is
 * the network's. */
#include "pack_cell.h"

static uint32_t outside_if(float value, const range_t *range, fault_t fault)
{
    return pack_bit_if(!((value >= range->low) && (value <= range->high)), fault);
}

/* Coolant beside a cell, which warms evenly along the string; what leaves the last one is measured. */
static float coolant_at_K(const pack_t *pack, uint32_t index, float inlet_K, float outlet_K)
{
    if (index + 1u == pack->cells) {
        return outlet_K;
    }
    return inlet_K + (float)(index + 1u) / (float)pack->cells * (outlet_K - inlet_K);
}

pack_cell_reading_t pack_cell_reading(const pack_t *pack, const pack_readings_t *readings,
                                      uint32_t index)
{
    const pack_cell_t *cell = &pack->cell[index];
    const plausibility_t *limits = &pack->calibration->plausibility;
    const bool is_bare = pack_is_bare(cell);
    const float inlet_K = readings->coolant_in_K;
    const float outlet_K = readings->coolant_out_K;
    pack_cell_reading_t reading = {
        .current_A = readings->current_A,
        .voltage_V = readings->voltage_V[index],
        .surface_temperature_K =
            is_bare ? NAN : readings->surface_temperature_K[cell->thermistor],
        .coolant_temperature_K = coolant_at_K(pack, index, inlet_K, outlet_K),
        .kept_coolant_K = coolant_at_K(pack, index, pack->coolant_in_K, pack->coolant_out_K),
        .cooling_power_W = readings->cooling_power_W,
    };
    const uint32_t surface =
        is_bare ? 0u
                : outside_if(reading.surface_temperature_K, &limits->surface_temperature_K,
                             FAULT_SURFACE_RANGE);
    const uint32_t coolant =
        outside_if(inlet_K, &limits->coolant_temperature_K, FAULT_COOLANT_RANGE) |
        outside_if(outlet_K, &limits->coolant_temperature_K, FAULT_COOLANT_RANGE);
    reading.outside =
        surface | coolant |
        outside_if(reading.current_A, &limits->current_A, FAULT_CURRENT_RANGE) |
        outside_if(reading.voltage_V, &limits->voltage_V, FAULT_VOLTAGE_RANGE) |
        outside_if(reading.cooling_power_W, &limits->cooling_power_W, FAULT_COOLING_RANGE);
    reading.is_surface_usable = !is_bare && (surface == 0u);
    reading.is_coolant_usable = coolant == 0u;
    return reading;
}

static bool current_deviates(const pack_t *pack, uint32_t index, float current_A)
{
    const bms_calibration_t *calibration = pack->calibration;
    const float deviation_A = calibration->plausibility.current_deviation_A;
    if (pack_has_family(pack)) {
        return !family_supply_is_plausible(&pack->family[index], &calibration->family, current_A,
                                           deviation_A);
    }
    return fabsf(current_A - pack->command_A) > deviation_A;
}

static bool voltage_deviates(const pack_t *pack, uint32_t index,
                             const pack_cell_reading_t *reading)
{
    const bms_calibration_t *calibration = pack->calibration;
    const rcbf_constants_t *constants = &calibration->rcbf;
    const float deviation_V = calibration->plausibility.voltage_deviation_V;
    if (pack_has_family(pack)) {
        const family_reading_t known = pack_family_reading(pack, reading, index);
        return !family_voltage_is_plausible(&pack->family[index], &calibration->family, constants,
                                            &known, deviation_V);
    }
    const float model_V = pack->cell[index].open_circuit_voltage_V -
                          reading->current_A * constants->ohmic_resistance_ohm;
    return fabsf(reading->voltage_V - model_V) > deviation_V;
}

static bool core_is_too_hot(const pack_t *pack, uint32_t index, const pack_cell_reading_t *reading)
{
    const bms_calibration_t *calibration = pack->calibration;
    const rcbf_constants_t *constants = &calibration->rcbf;
    const float overshoot_K = calibration->plausibility.temperature_overshoot_K;
    if (pack_has_family(pack)) {
        const family_reading_t known = pack_family_reading(pack, reading, index);
        return pack_is_charging(pack) &&
               family_is_too_hot(&pack->family[index], &calibration->family, constants, &known,
                                 overshoot_K);
    }
    return pack->cell[index].estimate.core_temperature_K >
           constants->max_core_temperature_K.high_K + constants->estimation_error_bound_K +
               overshoot_K;
}

uint32_t pack_cell_symptoms(const pack_t *pack, uint32_t index, const pack_cell_reading_t *reading)
{
    const bms_calibration_t *calibration = pack->calibration;
    const plausibility_t *limits = &calibration->plausibility;
    const rcbf_constants_t *constants = &calibration->rcbf;
    const pack_cell_t *cell = &pack->cell[index];
    const float surface_limit_K =
        constants->max_surface_temperature_K.high_K + limits->temperature_overshoot_K;
    uint32_t symptoms =
        reading->outside |
        pack_bit_if(!cell->estimate.in_domain && !pack_has_family(pack), FAULT_OUT_OF_DOMAIN) |
        pack_bit_if(current_deviates(pack, index, reading->current_A), FAULT_CURRENT_DEVIATION) |
        pack_bit_if(pack->soc_known && voltage_deviates(pack, index, reading),
                    FAULT_VOLTAGE_DEVIATION) |
        pack_bit_if(reading->voltage_V > constants->max_voltage_V + limits->voltage_overshoot_V,
                    FAULT_OVER_VOLTAGE);
    if (!pack_is_bare(cell)) {
        /* A bound is above its limit where the decision waits; only a reading is a fault there. */
        symptoms |=
            pack_bit_if(core_is_too_hot(pack, index, reading), FAULT_CORE_OVER_TEMPERATURE) |
            pack_bit_if(reading->surface_temperature_K > surface_limit_K,
                        FAULT_SURFACE_OVER_TEMPERATURE) |
            pack_bit_if(thermal_coldest_surface_K(&cell->thermal, &calibration->thermal) -
                                reading->surface_temperature_K >
                            limits->surface_deficit_K,
                        FAULT_SURFACE_DEFICIT);
    }
    return symptoms;
}
