/* Counts instructions of a pack's control period on an emulated target: for each number of cells the
 * least and the most that a period of a charge takes. hil_sim/studies/pack/cost.py reads the file.
 *
 * Command line: any name, and the file for the counts. Where each cell is warmer than those before,
 * each one moves the pack's current and has to find where its interval ends: the most that a period
 * can take. Where each is cooler the first one governs.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "pack.h"
#include "registers.h"
#include "semihosting.h"

#define TIMER_MASK 0xFFFFFFu
#define LONGEST_LINE 1024u
#define START_K 300.0f
#define STEP_K 0.005f /* between the surfaces of two cells */
#define SETTLING 10u
#define PERIODS 100u

typedef struct {
    uint32_t cells;
    uint32_t is_rising;
    uint32_t pack_bytes; /* of a pack of this many cells without a family */
    uint32_t nothing;
    uint32_t least;
    uint32_t most;
    uint32_t charging; /* periods with a decision */
} count_t;

typedef struct {
    pack_t pack;
    pack_readings_t readings;
    uint8_t thermistor_of[BMS_MAX_CELLS];
    float voltage_V[BMS_MAX_CELLS];
    float surface_K[BMS_MAX_CELLS];
    float soc[BMS_MAX_CELLS];
} rig_t;

static const uint32_t CELLS[] = { 1u, 4u, 16u, 96u, 192u };

/* Readings of a charge in which the surfaces rise towards their limit. */
static void take_readings(rig_t *rig, uint32_t cells, bool is_rising, uint32_t period)
{
    const bms_calibration_t *calibration = &BMS_DEFAULT_CALIBRATION;
    const float limit_K = calibration->rcbf.max_surface_temperature_K.high_K;
    const float warm_K = START_K + (limit_K - 2.0f - START_K) * (float)period / (float)PERIODS;
    rig->readings.current_A = rig->pack.command_A;
    for (uint32_t i = 0u; i < cells; i++) {
        const uint32_t order = is_rising ? i : (cells - 1u - i);
        rig->surface_K[i] = warm_K + STEP_K * (float)order;
        rig->voltage_V[i] =
            rcbf_open_circuit_voltage_V(&calibration->rcbf, rig->pack.cell[i].soc.soc) -
            rig->pack.command_A * calibration->rcbf.ohmic_resistance_ohm;
    }
}

static uint32_t ticks_of(rig_t *rig, bool is_idle)
{
    SYSTICK->VAL = 0u;
    const uint32_t before = SYSTICK->VAL;
    if (!is_idle) {
        pack_step(&rig->pack, &rig->readings);
    }
    return (before - SYSTICK->VAL) & TIMER_MASK;
}

static count_t count(rig_t *rig, uint32_t cells, bool is_rising)
{
    count_t counted = {
        .cells = cells,
        .is_rising = is_rising ? 1u : 0u,
        .pack_bytes = (uint32_t)(sizeof(pack_t) - sizeof(rig->pack.cell) -
                                 sizeof(rig->pack.family) + cells * sizeof(pack_cell_t)),
        .nothing = ticks_of(rig, true),
        .least = UINT32_MAX,
    };
    for (uint32_t i = 0u; i < cells; i++) {
        rig->thermistor_of[i] = (uint8_t)i;
        rig->soc[i] = 0.5f;
    }
    const pack_config_t config = {
        .calibration = &BMS_DEFAULT_CALIBRATION,
        .cells = cells,
        .thermistors = cells,
        .thermistor_of = rig->thermistor_of,
    };
    pack_init(&rig->pack, &config);
    rig->readings = (pack_readings_t){
        .voltage_V = rig->voltage_V,
        .surface_temperature_K = rig->surface_K,
        .coolant_in_K = START_K,
        .coolant_out_K = START_K,
        .reference_current_A = BMS_DEFAULT_CALIBRATION.reference_current_A,
        .plug_in_soc = rig->soc,
    };
    for (uint32_t i = 0u; i < SETTLING; i++) {
        take_readings(rig, cells, is_rising, 0u);
        for (uint32_t j = 0u; j < cells; j++) {
            rig->voltage_V[j] =
                rcbf_open_circuit_voltage_V(&BMS_DEFAULT_CALIBRATION.rcbf, rig->soc[j]);
        }
        pack_step(&rig->pack, &rig->readings);
    }
    rig->readings.charge = true;
    pack_step(&rig->pack, &rig->readings);
    for (uint32_t period = 0u; period < PERIODS; period++) {
        take_readings(rig, cells, is_rising, period);
        const uint32_t ticks = ticks_of(rig, false);
        if (rig->pack.command_A < 0.0f) {
            counted.charging++;
            counted.least = (ticks < counted.least) ? ticks : counted.least;
            counted.most = (ticks > counted.most) ? ticks : counted.most;
        }
    }
    return counted;
}

int main(void)
{
    static rig_t rig;
    static char line[LONGEST_LINE];
    semihosting_command_line(line, sizeof line);
    char *path = line;
    while ((*path != '\0') && (*path != ' ')) {
        path++;
    }
    path += (*path == ' ') ? 1 : 0;
    const int32_t results = semihosting_open(path, SEMIHOSTING_WRITE);
    SYSTICK->LOAD = TIMER_MASK;
    SYSTICK->CTRL = SYSTICK_ENABLE | SYSTICK_CORE_CLOCK;
    bool is_done = results >= 0;
    for (uint32_t i = 0u; is_done && (i < 2u * (sizeof CELLS / sizeof CELLS[0])); i++) {
        const count_t counted = count(&rig, CELLS[i / 2u], (i % 2u) != 0u);
        is_done = semihosting_write(results, &counted, sizeof counted) == 0u;
    }
    semihosting_exit(is_done ? 0u : 1u);
    return 0;
}
