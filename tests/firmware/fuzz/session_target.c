/* A charge in closed loop whose partner, frames, values and order an input chooses. */
#include <math.h>

#include "input.h"
#include "session.h"
#include "watch.h"

#define MOST_PERIODS 1500u

typedef struct {
    session_t session;
    watch_t watch;
    bms_t bms;
    float command_A;
    uint32_t left; /* more periods make an input too slow */
    can_frame_t last[CAN_RECEIVED_COUNT];
    uint32_t missing;   /* bit n: message n is not sent */
    uint32_t flipped;   /* of a message, plus 1: its next frame has this bit flipped */
    uint32_t flipped_bit;
    session_value_t wrong; /* VALUE_COUNT: none */
    float wrong_by;
} run_t;

static void restart(run_t *run)
{
    static const bms_config_t CONFIG = { &BMS_DEFAULT_CALIBRATION };
    bms_init(&run->bms, &CONFIG);
    watch_begin(&run->watch, &BMS_DEFAULT_CALIBRATION);
    run->command_A = 0.0f;
}

static void deliver(run_t *run, const can_frame_t *frame)
{
    watch_frame(&run->watch, frame);
    bms_receive(&run->bms, frame);
}

static void send(run_t *run)
{
    float values[VALUE_COUNT];
    session_measure(&run->session, values);
    if (run->wrong < VALUE_COUNT) {
        values[run->wrong] += run->wrong_by;
    }
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        if (!session_sends(&run->session, i) || ((run->missing >> i & 1u) != 0u)) {
            continue;
        }
        can_frame_t frame = session_frame(&run->session, i, values);
        if (run->flipped == i + 1u) {
            frame.data[run->flipped_bit / 8u] ^= (uint8_t)(1u << run->flipped_bit % 8u);
            run->flipped = 0u;
        }
        run->last[i] = frame;
        deliver(run, &frame);
    }
}

static void run_periods(run_t *run, uint32_t periods)
{
    for (; (periods > 0u) && (run->left > 0u); periods--, run->left--) {
        send(run);
        run->command_A = watch_step(&run->watch, &run->bms);
        session_advance(&run->session, run->command_A);
    }
}

static void foreign_frame(run_t *run, input_t *input)
{
    can_frame_t frame = { .id = input_16(input), .length = input_byte(input) };
    for (uint32_t i = 0u; i < 8u; i++) {
        frame.data[i] = input_byte(input);
    }
    deliver(run, &frame);
}

/* Of a message to the ECU, with a CRC that is right and a counter as the input has it. */
static void forged_frame(run_t *run, input_t *input)
{
    const uint32_t message = input_byte(input) % CAN_RECEIVED_COUNT;
    can_frame_t frame = { .id = CAN_RECEIVED[message].id, .length = CAN_RECEIVED[message].length };
    for (uint32_t i = 2u; i < 8u; i++) {
        frame.data[i] = input_byte(input);
    }
    const uint32_t choice = input_byte(input);
    const uint32_t next = run->session.counters[message];
    session_protect(&frame, message, (uint8_t)((choice < 16u) ? choice : next + choice));
    deliver(run, &frame);
}

static void wrong_value(run_t *run, input_t *input)
{
    static const float STEP[VALUE_COUNT] = { 0.5f, 0.02f, 1.0f, 1.0f, 0.1f,
                                             0.5f, 0.01f, 1.0f, 1.0f, 60.0f };
    run->wrong = (session_value_t)(input_byte(input) % VALUE_COUNT);
    const int32_t by = (int8_t)input_byte(input);
    run->wrong_by = (by == INT8_MIN) ? NAN : STEP[run->wrong] * (float)by;
    run_periods(run, 1u + input_byte(input) % 16u);
    run->wrong = VALUE_COUNT;
}

static void act(run_t *run, input_t *input)
{
    const uint32_t act = input_byte(input);
    session_t *session = &run->session;
    switch (act % 12u) {
    case 0u:
        run_periods(run, 1u + input_byte(input));
        break;
    case 1u: {
        const uint32_t choice = input_byte(input);
        session->is_on = (choice & 1u) != 0u;
        session->sends_mode = (choice & 2u) != 0u;
        session->mode = (codec_mode_t)(choice >> 2u & 3u);
        session->plug_in_soc = session->cell.soc;
        break;
    }
    case 2u:
        run->missing = input_byte(input);
        run_periods(run, 1u + input_byte(input) % 16u);
        run->missing = 0u;
        break;
    case 3u:
        wrong_value(run, input);
        break;
    case 4u:
        foreign_frame(run, input);
        break;
    case 5u:
        forged_frame(run, input);
        break;
    case 6u:
        deliver(run, &run->last[input_byte(input) % CAN_RECEIVED_COUNT]);
        break;
    case 7u: {
        const uint32_t message = input_byte(input) % CAN_RECEIVED_COUNT;
        session->counters[message] = input_byte(input);
        break;
    }
    case 8u: /* periods without a frame */
        for (uint32_t left = 1u + input_byte(input) % 8u; left > 0u; left--) {
            run->command_A = watch_step(&run->watch, &run->bms);
        }
        break;
    case 9u:
        run->flipped = 1u + input_byte(input) % CAN_RECEIVED_COUNT;
        run->flipped_bit = input_byte(input) % 64u;
        run_periods(run, 1u);
        break;
    case 10u:
        restart(run);
        break;
    default: /* another cell, or one that was heated */
        session->cell.soc = (float)input_byte(input) / 255.0f;
        session->cell.surface_K = 253.0f + 0.4f * (float)input_byte(input);
        session->cell.core_K = session->cell.surface_K;
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
    static run_t run;
    input_t input = { bytes, length };
    run = (run_t){ .left = MOST_PERIODS, .wrong = VALUE_COUNT };
    const float soc = 0.02f + 0.0038f * (float)input_byte(&input);
    session_begin(&run.session, soc, 288.0f + 0.11f * (float)input_byte(&input));
    restart(&run);
    while (input.left > 0u) {
        act(&run, &input);
    }
    run_periods(&run, 1u);
    return 0;
}
