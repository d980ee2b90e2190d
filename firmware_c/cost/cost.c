/* Counts instructions on an emulated target: reads records from a file of the host, runs what each
 * asks for, and writes the timer ticks that it took. hil_sim/studies/cost makes the records.
 *
 * Command line: any name, the file of records, the file for the ticks, and the calibration block of
 * a preset in place of the compiled-in one. The emulator lets its time advance by the same step with
 * every instruction, so that ticks are instructions.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bms.h"
#include "bms_symptoms.h"
#include "can_catalog.h"
#include "registers.h"
#include "semihosting.h"

#define TIMER_MASK 0xFFFFFFu
#define LONGEST_LINE 1024u

typedef enum { RESTART = 0, PERIOD = 1, STATE = 2 } record_kind_t;

typedef struct {
    float estimator_inputs[KAN_MAX_WIDTH];
    rcbf_input_t decision_input;
} state_t;

typedef struct {
    uint32_t kind; /* record_kind_t */
    uint32_t frames; /* that the ECU receives in a period */
    union {
        can_frame_t frames[CAN_RECEIVED_COUNT];
        state_t state;
    } content;
} record_t;

/* Ticks of nothing at all, too, which every other count contains. */
typedef struct {
    uint32_t nothing;
    uint32_t estimate;
    uint32_t observation; /* of a family; nothing for a single cell */
    uint32_t decision;
    uint32_t period;
} ticks_t;

typedef struct {
    const bms_calibration_t *calibration;
    bms_calibration_t loaded;
    record_t record;
    bms_t bms;
    can_frame_t sent;
    state_t state;
    uint8_t segment; /* of the voltage's table, as a period keeps it */
    rcbf_steadier_t steadier;
    family_t family; /* before the period's readings */
    family_reading_t reading;
    float result;
} cost_t;

static void do_nothing(cost_t *cost)
{
    cost->result = 0.0f;
}

static void estimate(cost_t *cost)
{
    cost->result = kan_evaluate(&cost->calibration->kan, cost->state.estimator_inputs)
                       .core_temperature_K;
}

static void decide(cost_t *cost)
{
    const rcbf_constants_t *constants = &cost->calibration->rcbf;
    const rcbf_input_t *input = &cost->state.decision_input;
    const float voltage_V =
        rcbf_open_circuit_voltage_near_V(constants, input->soc, &cost->segment);
    cost->result = rcbf_solve_steadily(constants, input, voltage_V, &cost->steadier).current_A;
}

static void decide_on_state(cost_t *cost)
{
    cost->result =
        rcbf_solve(&cost->calibration->rcbf, &cost->state.decision_input).current_A;
}

static void observe_family(cost_t *cost)
{
    family_observe(&cost->family, &cost->calibration->family, &cost->calibration->rcbf,
                   &cost->reading);
}

static void decide_for_family(cost_t *cost)
{
    cost->result = family_decide(&cost->bms.family, &cost->calibration->family,
                                 &cost->calibration->rcbf, &cost->reading,
                                 cost->bms.measurement.reference_current_A)
                       .current_A;
}

static void whole_period(cost_t *cost)
{
    for (uint32_t i = 0u; i < cost->record.frames; i++) {
        bms_receive(&cost->bms, &cost->record.content.frames[i]);
    }
    bms_step(&cost->bms);
    while (bms_transmit(&cost->bms, &cost->sent)) {
    }
}

/* What the last period has estimated and decided on, but with the reference as it was asked for:
 * without the bounds that bms_step puts on it and on its growth. */
static void take_state(cost_t *cost)
{
    const bms_t *bms = &cost->bms;
    const codec_measurement_t *m = &bms->measurement;
    cost->state = (state_t){
        .estimator_inputs = { m->current_A, m->cooling_power_W, bms->surface_temperature_K,
                              m->coolant_temperature_K },
        .decision_input = {
            .core_temperature_K = { .high_K = bms->estimate.core_temperature_K },
            .surface_temperature_K = { .high_K = bms->surface_temperature_K },
            .coolant_temperature_K = { .high_K = m->coolant_temperature_K },
            .cooling_power_W = m->cooling_power_W,
            .soc = bms->soc.soc,
            .reference_current_A = m->reference_current_A,
        },
    };
    for (uint32_t i = 0u; i < cost->calibration->kan.lags; i++) {
        cost->state.estimator_inputs[KAN_MEASURED_INPUTS + i] = bms->history.filtered[i];
    }
}

static uint32_t ticks_of(cost_t *cost, void (*work)(cost_t *))
{
    SYSTICK->VAL = 0u;
    const uint32_t before = SYSTICK->VAL;
    work(cost);
    return (before - SYSTICK->VAL) & TIMER_MASK;
}

/* Of the whole period, and of its parts each alone. */
static ticks_t play_period(cost_t *cost)
{
    ticks_t ticks = { .nothing = ticks_of(cost, do_nothing) };
    const float commanded_A = cost->bms.command_A;
    cost->family = cost->bms.family;
    ticks.period = ticks_of(cost, whole_period);
    cost->segment = cost->bms.ocv_segment;
    take_state(cost);
    cost->reading = reading_of(&cost->bms);
    cost->reading.command_A = commanded_A;
    ticks.estimate = ticks_of(cost, estimate);
    if (cost->calibration->family.is_stated != 0u) {
        ticks.observation = ticks_of(cost, observe_family);
        ticks.decision = ticks_of(cost, decide_for_family);
    } else {
        ticks.observation = ticks.nothing;
        rcbf_steadier_reset(&cost->steadier);
        ticks.decision = ticks_of(cost, decide);
    }
    return ticks;
}

/* A state is one of a single cell: a family's holds more than a record has. */
static ticks_t play_state(cost_t *cost)
{
    ticks_t ticks = { .nothing = ticks_of(cost, do_nothing) };
    ticks.observation = ticks.nothing;
    cost->state = cost->record.content.state;
    ticks.estimate = ticks_of(cost, estimate);
    ticks.decision = ticks_of(cost, decide_on_state);
    return ticks;
}

static bool play_file(cost_t *cost, int32_t records, int32_t results)
{
    const bms_config_t config = { cost->calibration };
    while (semihosting_read(records, &cost->record, sizeof cost->record) == sizeof cost->record) {
        if (cost->record.kind == RESTART) {
            bms_init(&cost->bms, &config);
            continue;
        }
        const ticks_t ticks =
            (cost->record.kind == PERIOD) ? play_period(cost) : play_state(cost);
        if (semihosting_write(results, &ticks, sizeof ticks) != 0u) {
            return false;
        }
    }
    return true;
}

/* The compiled-in calibration, or that of a file; false where the file does not hold a usable one. */
static bool take_calibration(cost_t *cost, const char *path)
{
    cost->calibration = &BMS_DEFAULT_CALIBRATION;
    if (*path == '\0') {
        return true;
    }
    cost->calibration = &cost->loaded;
    const int32_t file = semihosting_open(path, SEMIHOSTING_READ);
    const uint32_t length =
        (file >= 0) ? semihosting_read(file, &cost->loaded, sizeof cost->loaded) : 0u;
    return (length == offsetof(bms_calibration_t, kan) + kan_model_length(&cost->loaded.kan)) &&
           calibration_is_valid(&cost->loaded);
}

/* Ends the word where a blank stands, and gives what comes after it. */
static char *next_word(char *text)
{
    while ((*text != '\0') && (*text != ' ')) {
        text++;
    }
    if (*text == ' ') {
        *text = '\0';
        text++;
    }
    return text;
}

int main(void)
{
    static cost_t cost;
    static char line[LONGEST_LINE];
    semihosting_command_line(line, sizeof line);
    char *const records_path = next_word(line);
    char *const results_path = next_word(records_path);
    char *const calibration_path = next_word(results_path);
    (void)next_word(calibration_path);
    const int32_t records = semihosting_open(records_path, SEMIHOSTING_READ);
    const int32_t results = semihosting_open(results_path, SEMIHOSTING_WRITE);
    SYSTICK->LOAD = TIMER_MASK;
    SYSTICK->CTRL = SYSTICK_ENABLE | SYSTICK_CORE_CLOCK;
    const bool is_done = take_calibration(&cost, calibration_path) && (records >= 0) &&
                         (results >= 0) && play_file(&cost, records, results);
    semihosting_exit(is_done ? 0u : 1u);
    return 0;
}
