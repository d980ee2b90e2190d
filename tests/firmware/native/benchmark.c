/* Time of a control period of the ECU in a healthy charge, and what dominates it.
 *
 * Sixteen periods of frames are made beforehand, one for each value of the counter, and played
 * round and round; the state goes back to where it was after each round. Usage: benchmark ROUNDS.
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "session.h"

#define ROUND E2E_COUNTERS
#define REPETITIONS 7

typedef struct {
    bms_t start;
    bms_t bms;
    can_frame_t received[ROUND][CAN_RECEIVED_COUNT];
    codec_report_t report;
    can_frame_t sent;
    rcbf_input_t input;
    float measured[KAN_MEASURED_INPUTS];
    volatile float sink; /* keeps results alive */
} bench_t;

static void receive(bench_t *bench, uint32_t period)
{
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        bms_receive(&bench->bms, &bench->received[period][i]);
    }
}

static void run_period(bench_t *bench, uint32_t period)
{
    receive(bench, period);
    bms_step(&bench->bms);
    while (bms_transmit(&bench->bms, &bench->sent)) {
        bench->sink = (float)bench->sent.data[0];
    }
}

static void supervise(bench_t *bench, uint32_t period)
{
    (void)period;
    network_step(&bench->bms.network);
}

static void estimate(bench_t *bench, uint32_t period)
{
    bench->measured[0] += (float)period * 1e-6f;
    bench->sink = history_estimate(&bench->bms.history, &BMS_DEFAULT_CALIBRATION.kan,
                                   bench->measured)
                      .core_temperature_K;
}

static void decide(bench_t *bench, uint32_t period)
{
    bench->input.core_temperature_K.low_K = (float)period * 1e-9f;
    bench->sink = rcbf_solve(&BMS_DEFAULT_CALIBRATION.rcbf, &bench->input).current_A;
}

static void encode(bench_t *bench, uint32_t period)
{
    for (uint32_t i = 0u; i < CAN_TRANSMITTED_COUNT; i++) {
        if (period % CAN_TRANSMITTED[i].every_periods == 0u) {
            codec_write(i, &bench->report, &bench->sent);
            bench->sink = (float)bench->sent.data[7];
        }
    }
}

static void protect(bench_t *bench, uint32_t period)
{
    for (uint32_t i = 0u; i < CAN_TRANSMITTED_COUNT; i++) {
        if (CAN_TRANSMITTED[i].is_protected && (period % CAN_TRANSMITTED[i].every_periods == 0u)) {
            e2e_protect(bench->sent.data, CAN_TRANSMITTED[i].length, CAN_TRANSMITTED[i].data_ids,
                        (uint8_t)period);
            bench->sink = (float)bench->sent.data[0];
        }
    }
}

/* Nanoseconds of one period, the shortest of some repetitions. */
static double time_ns(bench_t *bench, void (*work)(bench_t *, uint32_t), uint32_t rounds)
{
    double shortest_ns = 1e12;
    for (uint32_t repetition = 0u; repetition < REPETITIONS; repetition++) {
        const clock_t begin = clock();
        for (uint32_t left = rounds; left > 0u; left--) {
            bench->bms = bench->start;
            for (uint32_t period = 0u; period < ROUND; period++) {
                work(bench, period);
            }
        }
        const double spent_ns = (double)(clock() - begin) * 1e9 / CLOCKS_PER_SEC;
        const double period_ns = spent_ns / ((double)rounds * ROUND);
        shortest_ns = (period_ns < shortest_ns) ? period_ns : shortest_ns;
    }
    return shortest_ns;
}

/* Charges until the current has grown to its limit, and keeps the last frames of every counter. */
static void prepare(bench_t *bench)
{
    const bms_config_t config = { &BMS_DEFAULT_CALIBRATION };
    session_t session;
    float values[VALUE_COUNT];
    session_begin(&session, 0.3f, 300.0f);
    bms_init(&bench->bms, &config);
    for (uint32_t period = 0u; period < 20u * ROUND; period++) {
        session.is_on = period >= 8u;
        session_measure(&session, values);
        for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
            bench->received[period % ROUND][i] = session_frame(&session, i, values);
        }
        run_period(bench, period % ROUND);
        session_advance(&session, bench->bms.command_A);
    }
    bench->start = bench->bms;
    bench->measured[0] = values[VALUE_CURRENT];
    bench->measured[1] = values[VALUE_COOLING];
    bench->measured[2] = values[VALUE_SURFACE];
    bench->measured[3] = values[VALUE_COOLANT];
    bench->input = (rcbf_input_t){
        .soc = bench->bms.soc.soc,
        .core_temperature_K = { .high_K = bench->bms.estimate.core_temperature_K },
        .surface_temperature_K = { .high_K = values[VALUE_SURFACE] },
        .coolant_temperature_K = { .high_K = values[VALUE_COOLANT] },
        .cooling_power_W = values[VALUE_COOLING],
        .reference_current_A = values[VALUE_REFERENCE],
    };
    bench->report.core_temperature_K = bench->bms.estimate.core_temperature_K;
    bench->report.command_A = bench->bms.command_A;
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        void (*work)(bench_t *, uint32_t);
    } PARTS[] = {
        { "receive_check_and_decode", receive }, { "supervise_messages", supervise },
        { "estimate_core_temperature", estimate }, { "decide_current", decide },
        { "encode", encode }, { "protect", protect },
    };
    static bench_t bench;
    const uint32_t rounds = (argc == 2) ? (uint32_t)strtoul(argv[1], NULL, 10) : 0u;
    if (rounds == 0u) {
        fprintf(stderr, "usage: benchmark ROUNDS\n");
        return 2;
    }
    prepare(&bench);
    const double whole_ns = time_ns(&bench, run_period, rounds);
    if ((bench.bms.state != BMS_CHARGING) || !(bench.bms.command_A < 0.0f)) {
        fprintf(stderr, "benchmark: the charge has stopped\n");
        return 1;
    }
    double rest_ns = whole_ns;
    printf("%-28s %8s %6s\n", "one control period", "ns", "%");
    for (uint32_t i = 0u; i < sizeof PARTS / sizeof PARTS[0]; i++) {
        const double part_ns = time_ns(&bench, PARTS[i].work, rounds);
        rest_ns -= part_ns;
        printf("%-28s %8.0f %6.1f\n", PARTS[i].name, part_ns, 100.0 * part_ns / whole_ns);
    }
    printf("%-28s %8.0f %6.1f\n", "rest", rest_ns, 100.0 * rest_ns / whole_ns);
    printf("%-28s %8.0f %6.1f\n", "whole", whole_ns, 100.0);
    return 0;
}
