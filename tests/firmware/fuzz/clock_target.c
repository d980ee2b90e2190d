/* The main loop of the ports on a clock and a bus that an input makes: time that stands, jumps, goes
 * back or wraps around, SYNC of anybody, frames early and late.
 */
#include "can_db.h"
#include "ecu_loop.h"
#include "input.h"
#include "port.h"
#include "session.h"
#include "watch.h"

#define MOST_TURNS 6000u

static struct {
    ecu_loop_t loop;
    session_t session;
    watch_t watch;
    uint32_t now_ms;
    can_frame_t waiting[8];
    uint32_t frames;
    can_frame_t last_sent;
    bool is_monotonic; /* the clock has not gone back yet */
    uint64_t elapsed_ms;
    uint32_t syncs;
    uint32_t turns;
} run;

bool port_receive(can_frame_t *frame)
{
    if (run.frames == 0u) {
        return false;
    }
    *frame = run.waiting[0];
    run.frames--;
    memmove(&run.waiting[0], &run.waiting[1], run.frames * sizeof run.waiting[0]);
    watch_frame(&run.watch, frame);
    return true;
}

void port_send(const can_frame_t *frame)
{
    run.last_sent = *frame;
    watch_sent(&run.watch, frame);
    if (frame->id == CAN_DB_CHARGE_COMMAND_FRAME_ID) {
        watch_end_period(&run.watch, frame);
    }
}

uint32_t port_time_ms(void)
{
    return run.now_ms;
}

void port_idle(uint32_t until_ms)
{
    MUST(!run.is_monotonic || ((int32_t)(until_ms - run.now_ms) <= (int32_t)ECU_LOOP_SYNC_SILENCE_MS),
         "the loop sleeps for longer than a silence");
}

static void turn(void)
{
    const uint32_t periods = run.loop.bms.periods;
    const bool keeps_clock = !run.loop.is_in_lock_step &&
                             ((run.loop.bms.state == BMS_CHARGING) ||
                              (run.loop.bms.state == BMS_DERATED));
    const bool is_sync = (run.frames > 0u) && (run.waiting[0].id == CAN_DB_SYNC_FRAME_ID);
    const bool is_due = (int32_t)(run.now_ms - run.loop.due_ms) >= 0;
    ecu_loop_turn(&run.loop);
    const uint32_t steps = run.loop.bms.periods - periods;
    MUST(steps <= 1u, "two steps in one turn");
    MUST((steps == 0u) || is_due || !keeps_clock || !is_sync,
         "a charge on its own clock steps by a foreign SYNC");
    run.turns++;
}

static void put(const can_frame_t *frame)
{
    run.waiting[run.frames] = *frame;
    run.frames++;
    run.syncs += (frame->id == CAN_DB_SYNC_FRAME_ID) ? 1u : 0u;
}

/* All messages of a healthy partner, and the turns that take them. */
static void send_all(void)
{
    float values[VALUE_COUNT];
    session_measure(&run.session, values);
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        if (session_sends(&run.session, i)) {
            const can_frame_t frame = session_frame(&run.session, i, values);
            put(&frame);
            turn();
        }
    }
}

static void pass(uint32_t ms)
{
    run.now_ms += ms;
    run.elapsed_ms += ms;
    turn();
}

static void act(input_t *input)
{
    static const can_frame_t SYNC = { .id = CAN_DB_SYNC_FRAME_ID };
    const uint32_t act = input_byte(input);
    switch (act % 8u) {
    case 0u: /* periods as they should be */
        for (uint32_t left = 1u + input_byte(input); (left > 0u) && (run.turns < MOST_TURNS); left--) {
            send_all();
            pass(50u);
            pass(50u);
            session_advance(&run.session, run.watch.command_A);
        }
        break;
    case 1u: /* the same in lock step */
        for (uint32_t left = 1u + input_byte(input); (left > 0u) && (run.turns < MOST_TURNS); left--) {
            send_all();
            put(&SYNC);
            turn();
            pass(1u + act / 8u);
            session_advance(&run.session, run.watch.command_A);
        }
        break;
    case 2u:
        pass(input_byte(input));
        break;
    case 3u: {
        const uint32_t jump_ms = input_32(input);
        run.is_monotonic = run.is_monotonic && (jump_ms <= INT32_MAX / 2);
        pass(jump_ms);
        break;
    }
    case 4u:
        put(&SYNC);
        turn();
        break;
    case 5u:
        run.session.is_on = (act & 8u) != 0u;
        run.session.plug_in_soc = run.session.cell.soc;
        break;
    case 6u: {
        can_frame_t frame = { .id = input_16(input) % 0x800u, .length = input_byte(input) % 9u };
        for (uint32_t i = 0u; i < frame.length; i++) {
            frame.data[i] = input_byte(input);
        }
        put(&frame);
        turn();
        break;
    }
    default:
        send_all();
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
    input_t input = { bytes, length };
    memset(&run, 0, sizeof run);
    run.is_monotonic = true;
    run.now_ms = input_32(&input);
    session_begin(&run.session, 0.3f, 298.0f);
    ecu_loop_init(&run.loop, &BMS_DEFAULT_CALIBRATION);
    watch_begin(&run.watch, &BMS_DEFAULT_CALIBRATION);
    const uint32_t period_ms = run.loop.period_ms;
    while ((input.left > 0u) && (run.turns < MOST_TURNS)) {
        act(&input);
    }
    /* The phase may be corrected by half a period now and then. */
    const uint64_t most = run.elapsed_ms / (period_ms / 2u) + run.syncs + 2u;
    MUST(!run.is_monotonic || (run.loop.bms.periods <= most), "more steps than the time has room for");
    return 0;
}
