/* Fuzzes the ECU application: charges in closed loop whose frames, values and order are damaged.
 *
 * After every period the frames of the ECU are read as a charger would read them. No current may
 * be commanded in a period that reports a fault or a symptom that stops, nor in one in which a
 * message to the ECU did not come intact. Build it with sanitizers; usage: fuzz FRAMES SEED.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "can_db.h"
#include "fuzz.h"

#define LATER_FAULTS 0xFFF00000u
#define ZERO_CURRENT_RAW 524288u /* 0 A, in the middle of 20 bits */

static void follow_request(fuzzer_t *fuzzer)
{
    random_t *random = &fuzzer->random;
    session_t *session = &fuzzer->session;
    const bool has_ended =
        (fuzzer->last_state == BMS_FAULT) || (fuzzer->last_state == BMS_COMPLETE);
    if (session->is_on && random_chance(random, has_ended ? 128u : 1u)) {
        session->is_on = false;
        fuzzer->off_periods = 1u + random_below(random, 16u);
    } else if (!session->is_on) {
        fuzzer->off_periods -= (fuzzer->off_periods > 0u) ? 1u : 0u;
        session->is_on = fuzzer->off_periods == 0u;
        session->plug_in_soc = session->cell.soc;
    }
}

/* A charger that says how to charge may be exchanged for one that does not. */
static void choose_mode(fuzzer_t *fuzzer)
{
    random_t *random = &fuzzer->random;
    fuzzer->session.sends_mode = random_chance(random, 512u);
    fuzzer->session.mode = random_chance(random, 512u) ? MODE_FIXED : MODE_FASTEST;
}

static bool is_refused(const fuzzer_t *fuzzer, const char *reason)
{
    const statistics_t *statistics = &fuzzer->statistics;
    fprintf(stderr, "fuzz: %s in period %" PRIu64 ", after %" PRIu64 " frames\n", reason,
            statistics->periods, statistics->frames);
    return false;
}

/* Reads what the ECU sends and holds the command to the rest. */
static bool listen(fuzzer_t *fuzzer)
{
    statistics_t *statistics = &fuzzer->statistics;
    struct can_db_charge_command_t command = { 0 };
    struct can_db_diagnostics_t report = { 0 };
    can_frame_t frame = { 0 };
    while (bms_transmit(&fuzzer->bms, &frame)) {
        if (frame.id == CAN_DB_DIAGNOSTICS_FRAME_ID) {
            (void)can_db_diagnostics_unpack(&report, frame.data, frame.length);
        }
    }
    if (frame.id != CAN_DB_CHARGE_COMMAND_FRAME_ID) {
        return is_refused(fuzzer, "the command is not the last frame");
    }
    (void)can_db_charge_command_unpack(&command, frame.data, frame.length);
    bool must_stop = report.latched_faults != 0u;
    /* Later faults than Diagnostics holds take turns in another message. */
    const uint32_t active = report.active_faults | (fuzzer->bms.monitor.active & LATER_FAULTS);
    for (uint32_t fault = 0u; fault < FAULT_COUNT; fault++) {
        const bool is_seen = (active >> fault & 1u) != 0u;
        must_stop = must_stop || (is_seen && MONITOR_POLICY[fault].stops_at_once);
        statistics->symptoms[fault] += is_seen ? 1u : 0u;
    }
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        must_stop = must_stop || (!CAN_RECEIVED[i].is_optional && !fuzzer->came_intact[i]);
        fuzzer->came_intact[i] = false;
        statistics->supervision[i][fuzzer->bms.network.receivers[i].state & 3u]++;
    }
    const uint32_t state = command.command_state;
    const bool has_current = command.command_current != ZERO_CURRENT_RAW;
    if ((state >= FUZZ_STATES) || (state != report.diagnostic_state)) {
        return is_refused(fuzzer, "the state is none");
    }
    if (has_current && must_stop) {
        return is_refused(fuzzer, "current in spite of a fault, a symptom or a missing message");
    }
    if (has_current && (state != BMS_CHARGING) && (state != BMS_DERATED)) {
        return is_refused(fuzzer, "current without a charge");
    }
    fuzzer->command_A =
        codec_decode(&CAN_SIGNALS[CAN_SIGNAL_COMMAND_CURRENT], command.command_current);
    if (!(fuzzer->command_A <= 1e-3f) ||
        !(fuzzer->command_A >= BMS_DEFAULT_CALIBRATION.reference_current_A - 1e-3f)) {
        return is_refused(fuzzer, "current beyond its limits");
    }
    if ((state == BMS_FAULT) && (fuzzer->last_state != BMS_FAULT) &&
        (report.first_fault < FAULT_COUNT)) {
        statistics->latched_first[report.first_fault]++;
    }
    const bool is_start = (state == BMS_CHARGING) || (state == BMS_DERATED);
    const bool was_charging =
        (fuzzer->last_state == BMS_CHARGING) || (fuzzer->last_state == BMS_DERATED);
    statistics->charges += (is_start && !was_charging) ? 1u : 0u;
    statistics->with_current += has_current ? 1u : 0u;
    statistics->states[state]++;
    fuzzer->last_state = state;
    return true;
}

static bool run_period(fuzzer_t *fuzzer)
{
    random_t *random = &fuzzer->random;
    float values[VALUE_COUNT];
    follow_request(fuzzer);
    if (random_chance(random, 1u)) {
        choose_mode(fuzzer);
    }
    session_measure(&fuzzer->session, values);
    fuzz_damage_values(fuzzer, values);
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        if (!session_sends(&fuzzer->session, i)) {
            continue;
        }
        const can_frame_t frame = session_frame(&fuzzer->session, i, values);
        if (random_chance(random, fuzzer->frame_share)) {
            fuzz_deliver_damaged(fuzzer, i, frame);
        } else {
            fuzz_deliver(fuzzer, &frame);
        }
        fuzzer->last_sent[i] = frame;
    }
    if (random_chance(random, fuzzer->foreign_share)) {
        fuzz_deliver_foreign(fuzzer);
    }
    const bool is_in_time = !random_chance(random, fuzzer->jitter_share);
    /* Who steps by a SYNC that is too slow leaves every other step out. */
    const uint32_t steps = (fuzzer->is_slow && (fuzzer->session.counters[0] % 2u == 0u)) ? 0u : 1u;
    for (uint32_t left = is_in_time ? steps : random_below(random, 3u); left > 0u; left--) {
        bms_step(&fuzzer->bms);
        fuzzer->statistics.periods++;
        if (!listen(fuzzer)) {
            return false;
        }
    }
    session_advance(&fuzzer->session, fuzzer->command_A);
    return true;
}

/* From plug-in on, for a while, with its own kinds and amount of damage. */
static bool run_episode(fuzzer_t *fuzzer, uint64_t frames)
{
    static const uint32_t SHARES[5] = { 0u, 1u, 8u, 64u, 400u };
    static const bms_config_t GOOD = { &BMS_DEFAULT_CALIBRATION }, NONE = { NULL };
    random_t *random = &fuzzer->random;
    fuzzer->frame_share = SHARES[random_below(random, 5u)];
    fuzzer->value_share = SHARES[random_below(random, 4u)];
    fuzzer->foreign_share = SHARES[random_below(random, 5u)];
    fuzzer->jitter_share = SHARES[random_below(random, 4u)];
    fuzzer->is_slow = random_chance(random, 50u);
    fuzzer->wrong_periods = 0u;
    fuzzer->command_A = 0.0f;
    fuzzer->off_periods = random_below(random, 16u);
    fuzzer->last_state = BMS_INIT;
    session_begin(&fuzzer->session, random_between(random, 0.02f, 0.985f),
                  random_between(random, 288.0f, 316.0f));
    choose_mode(fuzzer);
    bms_init(&fuzzer->bms, random_chance(random, 16u) ? &NONE : &GOOD);
    for (uint32_t left = 64u + random_below(random, 4096u); left > 0u; left--) {
        if (!run_period(fuzzer)) {
            return false;
        }
        if (fuzzer->statistics.frames >= frames) {
            break;
        }
    }
    return true;
}

static void print_row(const char *name, const char *const *labels, const uint64_t *numbers,
                      uint32_t count)
{
    printf("%s", name);
    for (uint32_t i = 0u; i < count; i++) {
        printf(" %s %" PRIu64, labels[i], numbers[i]);
    }
    printf("\n");
}

/* One line a subject: its name, then labels and numbers. Faults are numbered as in docs/can.md. */
static void print_statistics(const statistics_t *statistics)
{
    static const char *const MUTATIONS[MUTATION_COUNT] = {
        "dropped", "repeated", "old",     "swapped", "bit",     "byte",
        "length",  "id",       "content", "counter", "restart",
    };
    static const char *const STATES[FUZZ_STATES] = { "init",    "standby",  "charging",
                                                     "derated", "complete", "fault" };
    static const char *const SUPERVISION[E2E_INVALID + 1] = { "no_data", "init", "valid",
                                                              "invalid" };
    printf("run frames %" PRIu64 " periods %" PRIu64 " charges %" PRIu64
           " periods_with_current %" PRIu64 " foreign_frames %" PRIu64 " wrong_values %" PRIu64
           "\n",
           statistics->frames, statistics->periods, statistics->charges, statistics->with_current,
           statistics->foreign, statistics->values);
    print_row("damaged_frames", MUTATIONS, statistics->mutations, MUTATION_COUNT);
    print_row("periods_in", STATES, statistics->states, FUZZ_STATES);
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        printf("message_0x%03" PRIX32, CAN_RECEIVED[i].id);
        print_row("", SUPERVISION, statistics->supervision[i], E2E_INVALID + 1u);
    }
    for (uint32_t fault = 0u; fault < FAULT_COUNT; fault++) {
        printf("fault_%02" PRIu32 " periods %" PRIu64 " latched_first %" PRIu64 "\n", fault,
               statistics->symptoms[fault], statistics->latched_first[fault]);
    }
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: fuzz FRAMES SEED\n");
        return 2;
    }
    static fuzzer_t fuzzer;
    const uint64_t frames = strtoull(argv[1], NULL, 10);
    fuzzer.random.state = strtoull(argv[2], NULL, 10) * 2u + 1u;
    while (fuzzer.statistics.frames < frames) {
        if (!run_episode(&fuzzer, frames)) {
            return 1;
        }
    }
    print_statistics(&fuzzer.statistics);
    fprintf(stderr, "%.0f frames/s\n",
            (double)fuzzer.statistics.frames * CLOCKS_PER_SEC / (double)clock());
    return 0;
}
