/* The firmware's kernels against their plain forms on random states of one calibration, bit by bit.
 *
 * Inputs lie in and around box and limits, on knots and beside them; some are no number, infinite,
 * huge or tiny. Usage: kernels BLOCK STATES SEED, with a calibration in BLOCK. Prints how many
 * answers differ, and the first; exit code 1 when one does.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calibration.h"
#include "e2e.h"
#include "family_tables.h"
#include "plain_kernels.h"
#include "random.h"

#define SPECIAL_OF_1024 8u
#define NEW_START_OF_1024 4u
#define KERNELS 6u
#define STEP_K_PER_S 1e-6f /* rounding */

static const char *const NAMES[KERNELS] = { "estimate", "decision", "open_circuit_voltage",
                                            "checksum", "family_table", "family_decision" };

typedef struct {
    bms_calibration_t calibration;
    random_t random;
    rcbf_steadier_t steadier[2];
    uint8_t segment;
    family_t family;
    float soc;
    family_t cell; /* of the family, as the observer has it */
    family_reading_t reading;
    uint64_t stronger; /* decisions of a family than a solution for the core */
    float most_stronger_A;
    uint64_t differing[KERNELS];
    uint64_t reached[RCBF_INVALID + 1]; /* decisions by what decided */
    uint64_t family_reached[RCBF_CORE_UNKNOWN + 1];
    uint64_t in_domain;
} trial_t;

static float uniform(random_t *random, float low, float high)
{
    const float share = (float)(random_bits(random) >> 8u) * 0x1p-24f;
    return low + (high - low) * share;
}

static float special(random_t *random)
{
    static const float VALUES[] = { NAN, INFINITY, -INFINITY, 0.0f, -0.0f, FLT_MAX, -FLT_MAX,
                                    FLT_MIN, 0x1p-149f, -0x1p-149f, 1e30f, -1e30f, 1e4f, -1e4f };
    return VALUES[random_below(random, (uint32_t)(sizeof VALUES / sizeof VALUES[0]))];
}

static float number(random_t *random, float low, float high)
{
    return random_chance(random, SPECIAL_OF_1024) ? special(random) : uniform(random, low, high);
}

static bool same(float a, float b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

static void note(trial_t *trial, uint32_t kernel, bool is_same, const float *of, uint32_t count)
{
    if (is_same) {
        return;
    }
    if (trial->differing[kernel] == 0u) {
        fprintf(stderr, "kernels: %s differs at", NAMES[kernel]);
        for (uint32_t i = 0u; i < count; i++) {
            fprintf(stderr, " %.9g", (double)of[i]);
        }
        fprintf(stderr, "\n");
    }
    trial->differing[kernel]++;
}

static float normalised_input(trial_t *trial, uint32_t input)
{
    const kan_model_t *model = &trial->calibration.kan;
    random_t *random = &trial->random;
    const uint32_t numbers = model->cells + 1u + model->cells * KAN_CELL_COEFFICIENTS;
    switch (random_below(random, 8u)) {
    case 0u: /* a knot of this input's edge, or the number beside it */
        return nextafterf(model->tables[input * numbers + random_below(random, model->cells + 1u)],
                          (float)random_below(random, 3u) - 1.0f);
    case 1u: /* a face of the box */
        return nextafterf(random_chance(random, 512u) ? 1.0f : -1.0f,
                          (float)random_below(random, 3u) - 1.0f);
    case 2u:
        return uniform(random, -2.0f * model->input_reach, 2.0f * model->input_reach);
    default:
        return uniform(random, -1.0f, 1.0f);
    }
}

static void try_estimate(trial_t *trial)
{
    const kan_model_t *model = &trial->calibration.kan;
    float inputs[KAN_MAX_WIDTH];
    for (uint32_t i = 0u; i < model->width[0]; i++) {
        inputs[i] = random_chance(&trial->random, SPECIAL_OF_1024)
                        ? special(&trial->random)
                        : model->input_center[i] +
                              normalised_input(trial, i) / model->input_scale[i];
    }
    const kan_estimate_t quick = kan_evaluate(model, inputs);
    const kan_estimate_t plain = plain_estimate(model, inputs);
    trial->in_domain += plain.in_domain ? 1u : 0u;
    note(trial, 0u,
         same(quick.core_temperature_K, plain.core_temperature_K) &&
             (quick.in_domain == plain.in_domain),
         inputs, model->width[0]);
}

static rcbf_temperature_t temperature(random_t *random, float low_K, float high_K)
{
    const rcbf_temperature_t drawn = { number(random, low_K, high_K),
                                       random_chance(random, 512u)
                                           ? 0.0f
                                           : number(random, -3e-5f, 3e-5f) };
    return drawn;
}

static void try_decision(trial_t *trial)
{
    const rcbf_constants_t *k = &trial->calibration.rcbf;
    random_t *random = &trial->random;
    const float core_K = k->max_core_temperature_K.high_K;
    const float surface_K = k->max_surface_temperature_K.high_K;
    const float far_K = random_chance(random, 512u) ? 4.0f : 60.0f; /* of a limit */
    const rcbf_input_t input = {
        .core_temperature_K = temperature(random, core_K - far_K, core_K + 0.25f * far_K),
        .surface_temperature_K = temperature(random, surface_K - far_K, surface_K + 0.25f * far_K),
        .coolant_temperature_K = temperature(random, surface_K - far_K, surface_K + 2.0f),
        .cooling_power_W = number(random, -1.0f, 20.0f),
        .soc = random_chance(random, 256u) ? number(random, 0.97f, 1.01f)
                                           : number(random, -0.12f, 1.12f),
        .reference_current_A = number(random, 1.5f * trial->calibration.reference_current_A, 0.5f),
    };
    if (random_chance(random, NEW_START_OF_1024)) {
        rcbf_steadier_reset(&trial->steadier[0]);
        rcbf_steadier_reset(&trial->steadier[1]);
    } else if (random_chance(random, 256u)) {
        /* So that all conditions get to decide. */
        trial->steadier[0].core_K_per_s = number(random, -0.5f, 2.0f);
        trial->steadier[0].surface_K_per_s2 = number(random, -0.01f, 0.05f);
        trial->steadier[1] = trial->steadier[0];
    }
    const float ocv_V = plain_open_circuit_voltage_V(k, input.soc);
    const rcbf_decision_t quick =
        rcbf_solve_steadily(k, &input, ocv_V, &trial->steadier[0]);
    const rcbf_decision_t plain = plain_decision(k, &input, ocv_V, &trial->steadier[1]);
    bool is_same = same(quick.current_A, plain.current_A) && same(quick.lower_A, plain.lower_A) &&
                   same(quick.upper_A, plain.upper_A) && (quick.feasible == plain.feasible) &&
                   (quick.active == plain.active) &&
                   same(trial->steadier[0].core_K_per_s, trial->steadier[1].core_K_per_s) &&
                   same(trial->steadier[0].surface_K_per_s2, trial->steadier[1].surface_K_per_s2);
    for (uint32_t i = 0u; i < RCBF_CONSTRAINTS; i++) {
        is_same = is_same && same(quick.margins[i], plain.margins[i]);
    }
    trial->reached[plain.active]++;
    note(trial, 1u, is_same, &input.core_temperature_K.high_K, 9u);
}

/* Mostly near the last one. */
static float next_soc(trial_t *trial)
{
    random_t *random = &trial->random;
    const rcbf_constants_t *k = &trial->calibration.rcbf;
    switch (random_below(random, 16u)) {
    case 0u:
        return number(random, -0.2f, 1.2f);
    case 1u:
        return k->ocv_soc[random_below(random, k->ocv_points)];
    default:
        return trial->soc + uniform(random, -0.001f, 0.002f);
    }
}

static void try_tables(trial_t *trial)
{
    const rcbf_constants_t *k = &trial->calibration.rcbf;
    const family_constants_t *family = &trial->calibration.family;
    const float soc = next_soc(trial);
    trial->soc = (soc >= -0.2f) && (soc <= 1.2f) ? soc : 0.0f;
    const float near_V = rcbf_open_circuit_voltage_near_V(k, soc, &trial->segment);
    const float plain_V = plain_open_circuit_voltage_V(k, soc);
    note(trial, 2u, same(near_V, plain_V) && same(rcbf_open_circuit_voltage_V(k, soc), plain_V),
         &soc, 1u);
    const float high = trial->soc + uniform(&trial->random, 0.0f, 0.1f);
    family_look_up_cells(&trial->family, family, trial->soc, high);
    note(trial, 4u,
         same(trial->family.ocv_slope_V, plain_greatest(family->ocv_slope_V, trial->soc, high)) &&
             same(trial->family.entropic_V_per_K,
                  plain_greatest(family->entropic_V_per_K, trial->soc, high)),
         &trial->soc, 1u);
}

/* Readings that wander, as from period to period; the observer follows them. */
static void next_reading(trial_t *trial)
{
    random_t *random = &trial->random;
    const bms_calibration_t *calibration = &trial->calibration;
    const rcbf_constants_t *cell = &calibration->rcbf;
    family_reading_t *reading = &trial->reading;
    const float limit_K = cell->max_core_temperature_K.high_K;
    if (random_chance(random, NEW_START_OF_1024)) {
        const float soc = uniform(random, 0.0f, 1.0f);
        const float at_K = uniform(random, limit_K - 40.0f, limit_K + 2.0f);
        *reading = (family_reading_t){
            .voltage_V = plain_open_circuit_voltage_V(cell, soc),
            .surface_temperature_K = at_K,
            .coolant_temperature_K = at_K,
            .estimated_core_K = at_K,
            .is_usable = true,
        };
        family_reset(&trial->cell, &calibration->family);
        family_begin(&trial->cell, &calibration->family, cell, soc, reading);
    }
    reading->is_charging = random_chance(random, 900u);
    if (reading->is_charging) {
        reading->command_A = uniform(random, calibration->reference_current_A, 0.0f);
        reading->current_A = reading->command_A * uniform(random, 0.98f, 1.02f);
    } else if (random_chance(random, 512u)) {
        reading->command_A = 0.0f;
        reading->current_A = 0.0f;
    }
    reading->voltage_V += uniform(random, -0.01f, 0.0101f);
    reading->surface_temperature_K += uniform(random, -0.1f, 0.11f);
    reading->coolant_temperature_K += uniform(random, -0.1f, 0.1f);
    reading->estimated_core_K = reading->surface_temperature_K + uniform(random, -1.0f, 6.0f);
    family_observe(&trial->cell, &calibration->family, cell, reading);
}

static void try_family(trial_t *trial)
{
    if (trial->calibration.family.is_stated == 0u) {
        return;
    }
    random_t *random = &trial->random;
    next_reading(trial);
    family_reading_t reading = trial->reading;
    family_t known = trial->cell;
    if (random_chance(random, 960u)) {
        /* As after a rest, which would take many periods. */
        known.core_is_known = true;
        known.core_room_K = uniform(random, -0.5f, 20.0f);
    }
    if (random_chance(random, SPECIAL_OF_1024)) {
        float *const of[] = { &reading.current_A, &reading.voltage_V,
                              &reading.surface_temperature_K, &reading.coolant_temperature_K,
                              &reading.estimated_core_K };
        *of[random_below(random, 5u)] = special(random);
    }
    const float reference_A = number(random, 1.2f * trial->calibration.reference_current_A, 0.0f);
    const family_constants_t *family = &trial->calibration.family;
    const rcbf_constants_t *cell = &trial->calibration.rcbf;
    const rcbf_decision_t quick =
        family_decide(&known, family, cell, &reading, reference_A);
    const rcbf_decision_t plain =
        plain_family_decision(&known, family, cell, &reading, reference_A);
    trial->family_reached[plain.active]++;
    if ((quick.current_A <= plain.current_A) && (quick.active != RCBF_CORE) &&
        (plain.active == RCBF_CORE)) {
        /* The condition holds at the stronger current itself, so that it needs no solution. */
        const float left_K_per_s = plain_family_core_left(&known, family, cell, &reading,
                                                          reference_A, quick.current_A);
        if (left_K_per_s >= -STEP_K_PER_S) {
            trial->stronger++;
            trial->most_stronger_A =
                fmaxf(trial->most_stronger_A, plain.current_A - quick.current_A);
            return;
        }
    }
    note(trial, 5u,
         same(quick.current_A, plain.current_A) && (quick.active == plain.active) &&
             (quick.feasible == plain.feasible) && same(quick.margins[0], plain.margins[0]) &&
             same(quick.margins[2], plain.margins[2]),
         &reading.current_A, 5u);
}

static void try_checksum(trial_t *trial)
{
    uint8_t data[8];
    uint8_t ids[E2E_COUNTERS];
    for (uint32_t i = 0u; i < sizeof data; i++) {
        data[i] = (uint8_t)random_bits(&trial->random);
    }
    for (uint32_t i = 0u; i < E2E_COUNTERS; i++) {
        ids[i] = (uint8_t)random_bits(&trial->random);
    }
    const uint8_t length =
        (uint8_t)(E2E_HEADER_LENGTH + random_below(&trial->random, 9u - E2E_HEADER_LENGTH));
    const float shown = (float)data[1];
    note(trial, 3u,
         e2e_crc(data, length, ids) == plain_crc(data, length, ids[data[1] % E2E_COUNTERS]), &shown,
         1u);
}

static bool read_block(const char *path, bms_calibration_t *calibration)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    const size_t length = fread(calibration, 1u, sizeof *calibration, file);
    (void)fclose(file);
    return (length > 0u) && calibration_is_valid(calibration);
}

int main(int argc, char **argv)
{
    static trial_t trial;
    const uint64_t states = (argc == 4) ? strtoull(argv[2], NULL, 10) : 0u;
    if (states == 0u) {
        fprintf(stderr, "usage: kernels BLOCK STATES SEED\n");
        return 2;
    }
    if (!read_block(argv[1], &trial.calibration)) {
        fprintf(stderr, "kernels: %s: no valid calibration\n", argv[1]);
        return 2;
    }
    trial.random.state = strtoull(argv[3], NULL, 10) * 2u + 1u;
    rcbf_steadier_reset(&trial.steadier[0]);
    rcbf_steadier_reset(&trial.steadier[1]);
    for (uint64_t i = 0u; i < states; i++) {
        try_estimate(&trial);
        try_decision(&trial);
        try_tables(&trial);
        try_checksum(&trial);
        try_family(&trial);
    }
    uint64_t all = 0u;
    printf("{\"states\": %llu, \"in_domain\": %llu, \"decided_by\": [", (unsigned long long)states,
           (unsigned long long)trial.in_domain);
    for (uint32_t i = 0u; i <= RCBF_INVALID; i++) {
        printf("%s%llu", (i == 0u) ? "" : ", ", (unsigned long long)trial.reached[i]);
    }
    printf("], \"family_decided_by\": [");
    for (uint32_t i = 0u; i <= RCBF_CORE_UNKNOWN; i++) {
        printf("%s%llu", (i == 0u) ? "" : ", ", (unsigned long long)trial.family_reached[i]);
    }
    printf("], \"family_stronger\": %llu, \"most_stronger_A\": %.3g, "
           "\"differing\": {",
           (unsigned long long)trial.stronger, (double)trial.most_stronger_A);
    for (uint32_t i = 0u; i < KERNELS; i++) {
        all += trial.differing[i];
        printf("%s\"%s\": %llu", (i == 0u) ? "" : ", ", NAMES[i],
               (unsigned long long)trial.differing[i]);
    }
    printf("}}\n");
    return (all == 0u) ? 0 : 1;
}
