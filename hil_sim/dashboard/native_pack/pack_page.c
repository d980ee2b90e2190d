#include "pack_page.h"

#include <string.h>

static pack_scenario_t scenario;
static pack_charge_t charge;
static pack_page_look_t shown;
static normals_t normals;
static uint8_t every[PACK_PAGE_MOST_CELLS];

void *scenario_address(void)
{
    return &scenario;
}

uint32_t scenario_size(void)
{
    return (uint32_t)sizeof scenario;
}

void begin(void)
{
    for (uint32_t i = 0u; i < PACK_PAGE_MOST_CELLS; i++) {
        every[i] = (uint8_t)i;
    }
    memset(&charge, 0, sizeof charge);
    charge.plant.cells = scenario.cells;
    charge.plant.cell = scenario.cell;
    charge.plant.neighbour_W_per_K = scenario.neighbour_W_per_K;
    charge.plant.flow_W_per_K = scenario.flow_W_per_K;
    charge.period_s = scenario.period_s;
    charge.max_time_s = scenario.max_time_s;
    charge.reference_current_A = scenario.reference_current_A;
    charge.full_cooling_W = scenario.full_cooling_W;
    charge.coolant_floor_K = scenario.coolant_floor_K;
    charge.cooling_band_K = scenario.cooling_band_K;
    charge.noise_cutoff = scenario.noise_cutoff;
    charge.off_periods = scenario.off_periods;
    charge.current = scenario.current;
    charge.voltage = scenario.voltage;
    charge.surface = scenario.surface;
    charge.coolant = scenario.coolant;
    charge.power = scenario.power;
    charge.seen = scenario.cells;
    charge.seen_cell = every;
    charge.thermistor_cell = every;
    charge.plug_in_soc = scenario.plug_in_soc;
    normals_begin(&normals, &scenario.normals, scenario.seed, PACK_PAGE_SENSOR_STREAM);
    const pack_config_t config = {
        .calibration = &scenario.calibration,
        .cells = scenario.cells,
        .thermistors = scenario.cells,
        .thermistor_of = every,
        .bare = scenario.bare,
    };
    pack_charge_begin(&charge, &config);
}

uint32_t advance(uint32_t periods)
{
    double drawn[2 * PACK_PAGE_MOST_CELLS + PACK_SHARED_NORMALS];
    const uint32_t width = 2u * charge.plant.cells + PACK_SHARED_NORMALS;
    for (uint32_t i = 0u; (i < periods) && (charge.outcome == PACK_RUNNING); i++) {
        for (uint32_t n = 0u; n < width; n++) {
            drawn[n] = normals_next(&normals);
        }
        pack_charge_advance(&charge, drawn, 1u);
    }
    return (charge.outcome == PACK_RUNNING) ? 1u : 0u;
}

const void *look(void)
{
    shown.time_s = charge.time_s;
    shown.current_A = charge.current_A;
    shown.outcome = (double)charge.outcome;
    shown.governing = (double)charge.pack.decision.cell;
    shown.constraint = (double)charge.pack.decision.decision.active;
    for (uint32_t i = 0u; i < charge.plant.cells; i++) {
        const plant_cell_t *one = &charge.plant.cell[i];
        shown.cell[i] = (pack_page_cell_t){
            .soc = one->memory.state.soc,
            .core_temperature_K = one->memory.state.core,
            .surface_temperature_K = one->memory.state.surface,
            .voltage_V = plant_voltage_V(&charge.plant, i, charge.current_A),
            .peaks = one->peaks,
        };
    }
    return &shown;
}
