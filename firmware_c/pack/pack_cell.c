#include "pack_cell.h"

#include <stddef.h>

#include "numeric.h"

/* A reading just outside of the box, by no more than its error, is taken for one on its face. */
static float within_box(const kan_model_t *model, uint32_t input, float value, float error)
{
    const float reach = 1.0f / model->input_scale[input];
    const float low = model->input_center[input] - reach;
    const float high = model->input_center[input] + reach;
    if ((value < low) && (value >= low - error)) {
        return low;
    }
    return ((value > high) && (value <= high + error)) ? high : value;
}

/* Resistance that the cell's own voltage admits at most, and no more than that of any cell. A
 * current that is less than its error admits all. */
static float greatest_resistance_ohm(const pack_t *pack, pack_cell_t *cell,
                                     const pack_cell_reading_t *reading)
{
    const pack_bare_t *bare = &pack->bare;
    const bms_calibration_t *calibration = pack->calibration;
    const float most_ohm =
        bare->resistance_factor * calibration->thermal.ohmic_resistance_ohm;
    const float strength_A = -reading->current_A - bare->current_error_A;
    if (!pack->soc_known || !(strength_A > 0.0f)) {
        return most_ohm;
    }
    const float least_V = rcbf_open_circuit_voltage_near_V(
        &calibration->rcbf, cell->soc.soc - cell->untold_soc - bare->soc_error,
        &cell->bare_segment);
    const float seen_ohm = (reading->voltage_V + bare->voltage_error_V - least_V) / strength_A;
    return (seen_ohm < most_ohm) ? numeric_larger(seen_ohm, 0.0f) : most_ohm;
}

/* Hottest that the surface of a cell without a thermistor can be. */
static void bound_surface(pack_t *pack, pack_cell_t *cell, const pack_cell_reading_t *reading,
                          float current_A, float start_K)
{
    const pack_bare_t *bare = &pack->bare;
    if (!cell->thermal.is_known && (!reading->is_coolant_usable || !numeric_is_finite(start_K))) {
        return; /* the estimate stays outside of its domain */
    }
    thermal_constants_t own = pack->calibration->thermal;
    own.ohmic_resistance_ohm = greatest_resistance_ohm(pack, cell, reading);
    thermal_step(&cell->thermal, &own, current_A, start_K, reading->kept_coolant_K);
    const float core_K = cell->thermal.start_K + cell->thermal.core_rise_K;
    const float heat_W = (own.ohmic_resistance_ohm * current_A -
                          own.entropic_coefficient_V_per_K * core_K) *
                         current_A;
    /* A heat that is no number stays, and so refuses current. */
    if (!(heat_W <= cell->greatest_heat_W)) {
        cell->greatest_heat_W = heat_W;
    }
    cell->surface_temperature_K = thermal_predicted_surface_K(&cell->thermal) + bare->surface_K +
                                  bare->estimate_K +
                                  bare->surface_K_per_W * cell->greatest_heat_W;
    cell->estimate = (kan_estimate_t){ core_K, numeric_is_finite(cell->surface_temperature_K) };
}

/* As bms.c has it for one cell: a sensor that reads colder than the heat allows is not believed. */
static void follow_surface(pack_t *pack, pack_cell_t *cell, const pack_cell_reading_t *reading,
                           float current_A)
{
    const bms_calibration_t *calibration = pack->calibration;
    cell->surface_temperature_K = reading->surface_temperature_K;
    if (cell->thermal.is_known || (reading->is_surface_usable && reading->is_coolant_usable)) {
        thermal_step(&cell->thermal, &calibration->thermal, current_A,
                     reading->surface_temperature_K, reading->kept_coolant_K);
        const float least_K =
            pack_has_family(pack) ? thermal_coldest_surface_K(&cell->thermal, &calibration->thermal)
                                  : thermal_predicted_surface_K(&cell->thermal);
        if (cell->surface_temperature_K < least_K) {
            cell->surface_temperature_K = least_K;
        }
    }
}

static void estimate_core(pack_cell_t *cell, const bms_calibration_t *calibration,
                          const pack_cell_reading_t *reading, float current_A)
{
    history_step(&cell->history, &calibration->kan, current_A, cell->surface_temperature_K,
                 reading->is_surface_usable);
    float measured[KAN_MEASURED_INPUTS] = { reading->current_A, reading->cooling_power_W,
                                            cell->surface_temperature_K,
                                            reading->coolant_temperature_K };
    for (uint32_t i = 0u; i < KAN_MEASURED_INPUTS; i++) {
        measured[i] = within_box(&calibration->kan, i, measured[i],
                                 calibration->plausibility.reading_error[i]);
    }
    cell->estimate = history_estimate(&cell->history, &calibration->kan, measured);
}

static void look_up_voltage(const pack_t *pack, pack_cell_t *cell)
{
    if (!pack_has_family(pack)) {
        cell->open_circuit_voltage_V = rcbf_open_circuit_voltage_near_V(
            &pack->calibration->rcbf, cell->soc.soc, &cell->ocv_segment);
    }
}

family_reading_t pack_family_reading(const pack_t *pack, const pack_cell_reading_t *reading,
                                     uint32_t index)
{
    const pack_cell_t *cell = &pack->cell[index];
    const uint32_t needed = pack_bit_if(true, FAULT_CURRENT_RANGE) |
                            pack_bit_if(true, FAULT_VOLTAGE_RANGE) |
                            pack_bit_if(true, FAULT_SURFACE_RANGE) |
                            pack_bit_if(true, FAULT_COOLANT_RANGE);
    return (family_reading_t){
        .current_A = reading->current_A,
        .voltage_V = reading->voltage_V,
        .surface_temperature_K = cell->surface_temperature_K,
        .coolant_temperature_K = reading->coolant_temperature_K,
        .estimated_core_K = cell->estimate.in_domain ? cell->estimate.core_temperature_K : NAN,
        .command_A = pack->command_A,
        .is_usable = (reading->outside & needed) == 0u,
        .is_charging = pack_is_charging(pack),
    };
}

/* While no charge runs, a current that may be the sensor's offset is none: it would add up for as
 * long as the pack stands. */
static void count_charge(const pack_t *pack, pack_cell_t *cell, float current_A)
{
    const bms_calibration_t *calibration = pack->calibration;
    const bool is_charging = pack_is_charging(pack);
    if (is_charging || (fabsf(current_A) > PACK_REST_A)) {
        soc_count(&cell->soc, current_A, is_charging ? pack->command_A : current_A,
                  calibration->sampling_period_s, calibration->rcbf.capacity_As);
    }
}

void pack_cell_update(pack_t *pack, uint32_t index, const pack_cell_reading_t *reading,
                      float start_K)
{
    pack_cell_t *cell = &pack->cell[index];
    const bms_calibration_t *calibration = pack->calibration;
    const bool is_current_usable =
        (reading->outside & pack_bit_if(true, FAULT_CURRENT_RANGE)) == 0u;
    /* Without a usable reading the command is what has most likely flowed. */
    const float current_A = is_current_usable ? reading->current_A : pack->command_A;
    if (pack_is_bare(cell)) {
        bound_surface(pack, cell, reading, current_A, start_K);
    } else {
        follow_surface(pack, cell, reading, current_A);
        estimate_core(cell, calibration, reading, current_A);
    }
    if (pack_has_family(pack)) {
        const family_reading_t known = pack_family_reading(pack, reading, index);
        family_observe(&pack->family[index], &calibration->family, &calibration->rcbf, &known);
    }
    if (pack->soc_known) {
        count_charge(pack, cell, current_A);
        look_up_voltage(pack, cell);
    }
}

/* The most that was told or counted bounds every cell of the family from above, and the rest of its
 * bounds what was told. */
static void begin_family(pack_t *pack, const pack_readings_t *readings, uint32_t index)
{
    const bms_calibration_t *calibration = pack->calibration;
    const pack_cell_reading_t reading = pack_cell_reading(pack, readings, index);
    const family_reading_t known = pack_family_reading(pack, &reading, index);
    family_t *family = &pack->family[index];
    family_begin(family, &calibration->family, &calibration->rcbf, readings->plug_in_soc[index],
                 &known);
    if (pack->cell[index].untold_soc > 0.0f) {
        const float most_soc = pack->cell[index].soc.soc + calibration->family.plug_in_error;
        family->soc_high.soc =
            numeric_larger(family->soc_high.soc, numeric_smaller(most_soc, 1.0f));
    }
}

void pack_cell_begin(pack_t *pack, const pack_readings_t *readings, uint32_t index)
{
    pack_cell_t *cell = &pack->cell[index];
    const float told_soc = readings->plug_in_soc[index];
    float begin_soc = told_soc;
    if (pack->soc_known) {
        const float bled_soc = (readings->bled_soc != NULL) ? readings->bled_soc[index] : 0.0f;
        begin_soc = numeric_larger(cell->soc.soc - bled_soc, told_soc);
    }
    soc_set(&cell->soc, begin_soc);
    cell->untold_soc = begin_soc - told_soc;
    look_up_voltage(pack, cell);
    cell->decision_segment = cell->ocv_segment;
    if (pack_has_family(pack)) {
        begin_family(pack, readings, index);
    }
}

bool pack_cell_is_full(const pack_t *pack, uint32_t index)
{
    const bms_calibration_t *calibration = pack->calibration;
    return pack_has_family(pack) ? family_is_full(&pack->family[index], &calibration->family,
                                                  calibration->completion_soc)
                                 : (pack->cell[index].soc.soc >= calibration->completion_soc);
}

rcbf_decision_t pack_cell_decide(const pack_t *pack, uint32_t index,
                                 const pack_cell_reading_t *reading, float reference_current_A,
                                 uint8_t *segment, rcbf_steadier_t *steadier)
{
    const bms_calibration_t *calibration = pack->calibration;
    const pack_cell_t *cell = &pack->cell[index];
    if (pack_has_family(pack)) {
        const family_reading_t known = pack_family_reading(pack, reading, index);
        return family_decide(&pack->family[index], &calibration->family, &calibration->rcbf,
                             &known, reference_current_A);
    }
    const rcbf_input_t input = {
        .soc = cell->soc.soc + calibration->soc_error,
        .core_temperature_K = { cell->estimate.core_temperature_K, 0.0f },
        .surface_temperature_K = { cell->surface_temperature_K, 0.0f },
        .coolant_temperature_K = { reading->coolant_temperature_K, 0.0f },
        .cooling_power_W = reading->cooling_power_W,
        .reference_current_A = reference_current_A,
    };
    return rcbf_solve_steadily(
        &calibration->rcbf, &input,
        rcbf_open_circuit_voltage_near_V(&calibration->rcbf, input.soc, segment), steadier);
}
