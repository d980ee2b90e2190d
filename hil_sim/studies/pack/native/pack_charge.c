#include "pack_charge.h"

#include <math.h>
#include <stddef.h>

double pack_sensor_reading(const pack_sensor_t *sensor, double truth, double normal,
                           double noise_cutoff)
{
    const double cut = fmin(fmax(normal, -noise_cutoff), noise_cutoff);
    const double value = truth + sensor->noise_std * cut;
    return (sensor->resolution == 0.0) ? value
                                       : sensor->resolution * rint(value / sensor->resolution);
}

static float reading_of(const pack_charge_t *charge, const pack_sensor_t *sensor, double truth,
                        double normal)
{
    return (float)pack_sensor_reading(sensor, truth, normal, charge->noise_cutoff);
}

void pack_charge_begin(pack_charge_t *charge, const pack_config_t *config)
{
    pack_init(&charge->pack, config);
    charge->plant.inlet_K = charge->plant.cell[charge->plant.cells - 1u].memory.state.coolant;
    for (uint32_t i = 0u; i < charge->plant.cells; i++) {
        plant_cell_t *one = &charge->plant.cell[i];
        const cell_state_t *state = &one->memory.state;
        one->peaks = (cell_peaks_t){
            .soc = state->soc,
            .core_temperature_K = state->core,
            .surface_temperature_K = state->surface,
            .voltage_V = plant_voltage_V(&charge->plant, i, 0.0),
        };
    }
}

static double mean_of(const float *values, uint32_t count)
{
    double sum = 0.0;
    for (uint32_t i = 0u; i < count; i++) {
        sum += (double)values[i];
    }
    return sum / (double)count;
}

/* Two normal numbers are each cell's, for its voltage and its surface. */
void pack_charge_measure(pack_charge_t *charge, const double *normals, pack_measured_t *measured)
{
    plant_t *plant = &charge->plant;
    const double *shared = &normals[2u * plant->cells];
    const double outlet_K = plant->cell[plant->cells - 1u].memory.state.coolant;
    plant->cooling_power_W =
        charge->full_cooling_W *
        fmin(fmax((outlet_K - charge->coolant_floor_K) / charge->cooling_band_K, 0.0), 1.0);
    for (uint32_t i = 0u; i < charge->seen; i++) {
        const uint32_t cell = charge->seen_cell[i];
        measured->voltage_V[i] = reading_of(charge, &charge->voltage,
                                            plant_voltage_V(plant, cell, charge->current_A),
                                            normals[2u * cell]);
    }
    const uint32_t thermistors = charge->sees_mean ? charge->seen : charge->pack.thermistors;
    for (uint32_t i = 0u; i < thermistors; i++) {
        const uint32_t cell = charge->thermistor_cell[i];
        measured->surface_temperature_K[i] =
            reading_of(charge, &charge->surface, plant->cell[cell].memory.state.surface,
                       normals[2u * cell + 1u]);
    }
    if (charge->sees_mean) {
        measured->voltage_V[0] = (float)mean_of(measured->voltage_V, charge->seen);
        measured->surface_temperature_K[0] =
            (float)mean_of(measured->surface_temperature_K, charge->seen);
    }
    measured->current_A = reading_of(charge, &charge->current, charge->current_A, shared[0]);
    measured->coolant_in_K = reading_of(charge, &charge->coolant, plant->inlet_K, shared[1]);
    measured->coolant_out_K = reading_of(charge, &charge->coolant, outlet_K, shared[2]);
    measured->cooling_power_W =
        reading_of(charge, &charge->power, plant->cooling_power_W, shared[3]);
}

static void ask_core(pack_charge_t *charge, const double *normals)
{
    pack_measured_t measured;
    pack_charge_measure(charge, normals, &measured);
    const pack_readings_t readings = {
        .current_A = measured.current_A,
        .voltage_V = measured.voltage_V,
        .surface_temperature_K = measured.surface_temperature_K,
        .coolant_in_K = measured.coolant_in_K,
        .coolant_out_K = measured.coolant_out_K,
        .cooling_power_W = measured.cooling_power_W,
        .charge = charge->requested,
        .reference_current_A = (float)charge->reference_current_A,
        .plug_in_soc = charge->plug_in_soc,
    };
    pack_step(&charge->pack, &readings);
}

static pack_outcome_t outcome_of(const pack_charge_t *charge)
{
    if (charge->pack.state == BMS_FAULT) {
        return PACK_FAULT;
    }
    if (charge->requested && (charge->pack.state == BMS_COMPLETE)) {
        return PACK_COMPLETE;
    }
    const double run_s = (double)(charge->periods - charge->edge_period) * charge->period_s;
    return (run_s >= charge->max_time_s) ? PACK_TIME_LIMIT : PACK_RUNNING;
}

static void run_period(pack_charge_t *charge, const double *normals)
{
    plant_t *plant = &charge->plant;
    ask_core(charge, normals);
    const double command_A =
        fmin(fmax((double)charge->pack.command_A, charge->reference_current_A), 0.0);
    charge->time_s = (double)(charge->periods - charge->edge_period) * charge->period_s;
    charge->periods++;
    charge->outcome = outcome_of(charge);
    if (charge->outcome != PACK_RUNNING) {
        return;
    }
    if (charge->requested) {
        charge->stops += ((charge->current_A < 0.0) && (command_A == 0.0)) ? 1u : 0u;
        if (charge->pack.decision.cell != PACK_NO_CELL) {
            charge->governed[charge->pack.decision.cell]++;
        }
    } else if ((charge->periods >= charge->off_periods) && (charge->pack.state == BMS_STANDBY)) {
        charge->requested = true;
        charge->edge_period = charge->periods;
    }
    charge->current_A = command_A;
    plant_hold(plant, command_A, PACK_SUB_STEPS);
}

void pack_charge_advance(pack_charge_t *charge, const double *normals, uint32_t periods)
{
    const uint32_t width = 2u * charge->plant.cells + PACK_SHARED_NORMALS;
    for (uint32_t i = 0u; (i < periods) && (charge->outcome == PACK_RUNNING); i++) {
        run_period(charge, &normals[(size_t)i * width]);
    }
}

void pack_repeat(pack_t *pack, const pack_readings_t *readings, uint32_t sets, uint32_t periods)
{
    for (uint32_t i = 0u; i < periods; i++) {
        pack_step(pack, &readings[i % sets]);
    }
}
