/* Counts instructions of a period of a pack's ECU on an emulated target, from the first frame that it
 * takes to the last one that it gives: the least and the most of a charge in which each cell is warmer
 * than those before it. hil_sim/pack/cost.py reads the file.
 *
 * Command line: any name, and the file for the counts.
 */
#include <stdbool.h>
#include <stdint.h>

#include "pack_codec.h"
#include "pack_ecu.h"
#include "registers.h"
#include "semihosting.h"

#define TIMER_MASK 0xFFFFFFu
#define LONGEST_LINE 1024u
#define START_K 300.0f
#define STEP_K 0.005f /* between the surfaces of two cells */
#define SETTLING 30u
#define PERIODS 100u
#define MOST_FRAMES 160u

typedef struct {
    uint32_t cells;
    uint32_t frames; /* that the ECU takes in a period */
    uint32_t nothing;
    uint32_t least;
    uint32_t most;
    uint32_t charging; /* periods with a current */
} count_t;

typedef struct {
    pack_ecu_t ecu;
    uint8_t thermistor_of[BMS_MAX_CELLS];
    float voltage_V[BMS_MAX_CELLS];
    float surface_K[BMS_MAX_CELLS];
    float soc[BMS_MAX_CELLS];
    can_frame_t frame[MOST_FRAMES];
    uint32_t frames;
    uint32_t turn;
    uint8_t turn_counter; /* all pages in turn count alike, once for each time around */
} rig_t;

static const uint32_t CELLS[] = { 1u, 16u, 96u, 192u };

/* Of the ordinary spread on paper_calibrated, rounded; what it costs does not depend on them. */
static const pack_horizon_t NOW = { 0.2f,  10.4f,   0.009f, 1e-4f,  0.11f, 0.04f,
                                    0.042f, 0.028f, 0.0017f, 0.0023f, 0.18f };
static const pack_horizon_t SOON = { 10.0f, 10.4f,  0.45f,  0.005f, 0.74f, 0.26f,
                                     0.28f, 0.028f, 0.086f, 0.11f,  0.18f };

static void add(rig_t *rig, const codec_message_t *message, uint64_t bits, uint32_t counter)
{
    can_frame_t *frame = &rig->frame[rig->frames];
    rig->frames++;
    pack_fill(frame, message, bits);
    e2e_protect(frame->data, frame->length, message->data_ids, (uint8_t)counter);
}

static void add_page(rig_t *rig, uint32_t group, uint32_t page, const float *values, uint32_t cells,
                     uint32_t counter)
{
    can_frame_t *frame = &rig->frame[rig->frames];
    rig->frames++;
    pack_fill_page(frame, group, page, &values[page * PACK_CELLS_A_PAGE],
                   pack_cells_from(cells, page));
    e2e_protect(frame->data, frame->length, pack_page_message(group, page)->data_ids,
                (uint8_t)counter);
}

static void add_pages(rig_t *rig, uint32_t cells, uint32_t period)
{
    const uint32_t pages = pack_pages(cells);
    for (uint32_t page = 0u; page < pages; page++) {
        add_page(rig, PACK_GROUP_CELL_VOLTAGES, page, rig->voltage_V, cells, period);
        add_page(rig, PACK_GROUP_CELL_TEMPERATURES, page, rig->surface_K, cells, period);
    }
    const uint32_t turns = PACK_GROUPS[PACK_GROUP_PLUG_IN_CHARGES].pages_a_period;
    for (uint32_t i = 0u; (i < turns) && (i < pages); i++) {
        add_page(rig, PACK_GROUP_PLUG_IN_CHARGES, rig->turn, rig->soc, cells, rig->turn_counter);
        rig->turn = (rig->turn + 1u) % pages;
        rig->turn_counter = (uint8_t)(rig->turn_counter + ((rig->turn == 0u) ? 1u : 0u));
    }
}

/* A charge in which the surfaces rise towards their limit. */
static void make_frames(rig_t *rig, uint32_t cells, uint32_t period)
{
    const bms_calibration_t *calibration = &BMS_DEFAULT_CALIBRATION;
    const float limit_K = calibration->rcbf.max_surface_temperature_K.high_K;
    const bool is_asked = period >= SETTLING;
    const float share = is_asked ? ((float)(period - SETTLING) / (float)PERIODS) : 0.0f;
    const float warm_K = START_K + (limit_K - 2.0f - START_K) * share;
    const float command_A = rig->ecu.command_A;
    float sum_V = 0.0f;
    for (uint32_t i = 0u; i < cells; i++) {
        const float soc = rig->ecu.pack.soc_known ? rig->ecu.pack.cell[i].soc.soc : rig->soc[i];
        rig->surface_K[i] = warm_K + STEP_K * (float)i;
        rig->voltage_V[i] = rcbf_open_circuit_voltage_V(&calibration->rcbf, soc) -
                            command_A * calibration->rcbf.ohmic_resistance_ohm;
        sum_V += rig->voltage_V[i];
    }
    rig->frames = 0u;
    add(rig, &PACK_RECEIVED[PACK_RECEIVED_ELECTRICAL],
        pack_with_value(PACK_SIGNAL_PACK_CURRENT, command_A, CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_PACK_VOLTAGE, sum_V, CODEC_NEAREST),
        period);
    add(rig, &PACK_RECEIVED[PACK_RECEIVED_COOLANT],
        pack_with_value(PACK_SIGNAL_COOLANT_IN_TEMPERATURE, START_K, CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_COOLANT_OUT_TEMPERATURE, START_K, CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_CELL_COOLING_POWER, 0.0f, CODEC_NEAREST),
        period);
    add(rig, &PACK_RECEIVED[PACK_RECEIVED_REQUEST],
        pack_with_code(PACK_SIGNAL_REQUEST, is_asked ? REQUEST_CHARGE : REQUEST_OFF) |
            pack_with_value(PACK_SIGNAL_REFERENCE_CURRENT, calibration->reference_current_A,
                            CODEC_NEAREST) |
            pack_with_code(PACK_SIGNAL_CELLS_IN_SERIES, cells),
        period);
    add_pages(rig, cells, period);
}

static uint32_t ticks_of(rig_t *rig, bool is_idle)
{
    can_frame_t answer;
    SYSTICK->VAL = 0u;
    const uint32_t before = SYSTICK->VAL;
    if (!is_idle) {
        for (uint32_t i = 0u; i < rig->frames; i++) {
            pack_ecu_receive(&rig->ecu, &rig->frame[i]);
        }
        pack_ecu_step(&rig->ecu);
        while (pack_ecu_transmit(&rig->ecu, &answer)) {
        }
    }
    return (before - SYSTICK->VAL) & TIMER_MASK;
}

static count_t count(rig_t *rig, uint32_t cells)
{
    count_t counted = { .cells = cells, .nothing = ticks_of(rig, true), .least = UINT32_MAX };
    for (uint32_t i = 0u; i < cells; i++) {
        rig->thermistor_of[i] = (uint8_t)i;
        rig->soc[i] = 0.5f;
    }
    rig->turn = 0u;
    rig->turn_counter = 0u;
    const pack_ecu_config_t config = {
        .pack = { .calibration = &BMS_DEFAULT_CALIBRATION,
                  .cells = cells,
                  .thermistors = cells,
                  .thermistor_of = rig->thermistor_of },
        .pack_voltage_error_V = 1.0f,
        .now = NOW,
        .soon = SOON,
        .balance = { 10.0f, 0.8f, 0.002f },
    };
    pack_ecu_init(&rig->ecu, &config);
    for (uint32_t period = 0u; period < SETTLING + PERIODS; period++) {
        make_frames(rig, cells, period);
        const uint32_t ticks = ticks_of(rig, false);
        if (rig->ecu.command_A < 0.0f) {
            counted.charging++;
            counted.least = (ticks < counted.least) ? ticks : counted.least;
            counted.most = (ticks > counted.most) ? ticks : counted.most;
        }
    }
    counted.frames = rig->frames;
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
    for (uint32_t i = 0u; is_done && (i < sizeof CELLS / sizeof CELLS[0]); i++) {
        const count_t counted = count(&rig, CELLS[i]);
        is_done = semihosting_write(results, &counted, sizeof counted) == 0u;
    }
    semihosting_exit(is_done ? 0u : 1u);
    return 0;
}
