#include "pack.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

#include "numeric.h"
#include "pack_cell.h"

/* Of the preset's growth and of its strongest current; as bms_growth.c has them for one cell. */
#define LEAST_GROWTH 0.0067f
#define GROWTH_RISE 0.0133f
#define MOST_RISE 0.006f

static const pack_decision_t NO_DECISION = {
    { 0.0f, false, RCBF_INVALID, NAN, NAN, { NAN, NAN, NAN, NAN } }, PACK_NO_CELL
};

static bool bare_is_valid(const pack_bare_t *bare)
{
    const float numbers[] = { bare->resistance_factor, bare->soc_error,       bare->voltage_error_V,
                              bare->current_error_A,   bare->surface_K,       bare->surface_K_per_W,
                              bare->estimate_K };
    bool is_valid = bare->resistance_factor > 0.0f;
    for (uint32_t i = 0u; i < NUMERIC_COUNT(numbers); i++) {
        is_valid = is_valid && numeric_is_within(numbers[i], 0.0f, FLT_MAX);
    }
    return is_valid;
}

/* Each thermistor is at one cell, so that no cell passes for another and none has no cell. */
static bool map_is_valid(const pack_config_t *config)
{
    uint32_t owners = 0u;
    for (uint32_t i = 0u; i < config->cells; i++) {
        const uint8_t thermistor = config->thermistor_of[i];
        if (thermistor == PACK_NO_THERMISTOR) {
            continue;
        }
        if (thermistor >= config->thermistors) {
            return false;
        }
        for (uint32_t j = 0u; j < i; j++) {
            if (thermistor == config->thermistor_of[j]) {
                return false;
            }
        }
        owners++;
    }
    if (owners != config->thermistors) {
        return false;
    }
    return (owners == config->cells) ||
           ((config->calibration->family.is_stated == 0u) && (owners > 0u) &&
            bare_is_valid(&config->bare));
}

static bool config_is_valid(const pack_config_t *config)
{
    if ((config == NULL) || (config->calibration == NULL) || (config->thermistor_of == NULL) ||
        !calibration_is_valid(config->calibration)) {
        return false;
    }
    const uint32_t most = (config->calibration->family.is_stated != 0u) ? BMS_MAX_FAMILY_CELLS
                                                                        : BMS_MAX_CELLS;
    return (config->cells >= 1u) && (config->cells <= most) && map_is_valid(config);
}

void pack_init(pack_t *pack, const pack_config_t *config)
{
    pack->calibration = NULL;
    pack->state = BMS_INIT;
    pack->cells = 0u;
    pack->thermistors = 0u;
    pack->may_start = false;
    pack->soc_known = false;
    pack->symptom_cell = PACK_NO_CELL;
    pack->limit_cell = PACK_NO_CELL;
    pack->limit = RCBF_NONE;
    pack->growth_A = 0.0f;
    pack->command_A = 0.0f;
    pack->coolant_in_K = 0.0f;
    pack->coolant_out_K = 0.0f;
    pack->decision = NO_DECISION;
    monitor_reset(&pack->monitor);
    if (!config_is_valid(config)) {
        return;
    }
    pack->calibration = config->calibration;
    pack->cells = config->cells;
    pack->thermistors = config->thermistors;
    pack->bare = config->bare;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        pack_cell_t *cell = &pack->cell[i];
        *cell = (pack_cell_t){ .estimate = { NAN, false },
                               .thermistor = config->thermistor_of[i] };
        history_reset(&cell->history);
        thermal_reset(&cell->thermal);
        if (pack_has_family(pack)) {
            family_reset(&pack->family[i], &pack->calibration->family);
        }
    }
}

static bool is_within(float value, const range_t *range)
{
    return numeric_is_within(value, range->low, range->high);
}

/* Temperature at which cells without a thermistor are taken to start: the hottest that is measured,
 * where all are plausible. */
static float hottest_reading_K(const pack_t *pack, const pack_readings_t *readings)
{
    const range_t *limits = &pack->calibration->plausibility.surface_temperature_K;
    float hottest_K = -FLT_MAX;
    for (uint32_t i = 0u; i < pack->thermistors; i++) {
        const float reading_K = readings->surface_temperature_K[i];
        if (!is_within(reading_K, limits)) {
            return NAN;
        }
        hottest_K = numeric_larger(hottest_K, reading_K);
    }
    return hottest_K;
}

static void keep_coolant(pack_t *pack, const pack_readings_t *readings)
{
    const range_t *limits = &pack->calibration->plausibility.coolant_temperature_K;
    if (is_within(readings->coolant_in_K, limits) && is_within(readings->coolant_out_K, limits)) {
        pack->coolant_in_K = readings->coolant_in_K;
        pack->coolant_out_K = readings->coolant_out_K;
    }
}

static uint32_t update_cells(pack_t *pack, const pack_readings_t *readings)
{
    const float start_K = hottest_reading_K(pack, readings);
    uint32_t symptoms = 0u;
    pack->symptom_cell = PACK_NO_CELL;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        const pack_cell_reading_t reading = pack_cell_reading(pack, readings, i);
        pack_cell_update(pack, i, &reading, start_K);
        const uint32_t own = pack_cell_symptoms(pack, i, &reading);
        if ((own != 0u) && (pack->symptom_cell == PACK_NO_CELL)) {
            pack->symptom_cell = (uint8_t)i;
        }
        symptoms |= own;
    }
    return symptoms;
}

static bool request_is_possible(const pack_t *pack, const pack_readings_t *readings)
{
    if (!readings->charge) {
        return true;
    }
    bool is_possible = readings->reference_current_A <= 0.0f;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        is_possible = is_possible && numeric_is_within(readings->plug_in_soc[i], 0.0f,
                                                       pack->calibration->rcbf.max_soc);
    }
    return is_possible;
}

static bool is_settling(const pack_t *pack)
{
    bool settles = false;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        settles = settles || (!pack_is_bare(&pack->cell[i]) &&
                              history_is_settling(&pack->cell[i].history, &pack->calibration->kan));
    }
    return settles;
}

static void follow_request(pack_t *pack, const pack_readings_t *readings, uint32_t symptoms)
{
    if (!readings->charge) {
        pack->may_start = true;
        if ((pack->state == BMS_FAULT) && (symptoms == 0u)) {
            monitor_reset(&pack->monitor);
            pack->state = BMS_STANDBY;
        } else if (pack->state != BMS_FAULT) {
            pack->state = BMS_STANDBY;
        }
    } else if ((pack->state == BMS_STANDBY) && pack->may_start && (symptoms == 0u)) {
        for (uint32_t i = 0u; i < pack->cells; i++) {
            pack_cell_begin(pack, readings, i);
        }
        pack->soc_known = true;
        pack->may_start = false;
        pack->state = BMS_CHARGING;
    }
}

static bool is_full(const pack_t *pack)
{
    for (uint32_t i = 0u; i < pack->cells; i++) {
        if (pack_cell_is_full(pack, i)) {
            return true;
        }
    }
    return false;
}

/* Each cell is given the current of those before it as its reference: what it then changes, it
 * narrows, and a cell that does not govern need not find where its interval ends. All cells are
 * asked, since each carries on what steadies it. */
static pack_decision_t decide_together(pack_t *pack, const pack_readings_t *readings,
                                       float wanted_A)
{
    pack_decision_t all = { .cell = PACK_NO_CELL };
    float reference_A = wanted_A;
    float upper_A = FLT_MAX;
    bool is_refused = false;
    for (uint32_t i = 0u; i < pack->cells; i++) {
        pack_cell_t *cell = &pack->cell[i];
        const pack_cell_reading_t reading = pack_cell_reading(pack, readings, i);
        const rcbf_decision_t own = pack_cell_decide(pack, i, &reading, reference_A,
                                                     &cell->decision_segment, &cell->steadier);
        upper_A = numeric_smaller(upper_A, own.upper_A);
        if (is_refused) {
            continue;
        }
        if ((i == 0u) || (own.active != RCBF_NONE)) {
            all.decision = own;
            all.cell = (own.active != RCBF_NONE) ? (uint8_t)i : PACK_NO_CELL;
            reference_A = own.current_A;
        }
        if (!own.feasible) {
            is_refused = true;
        }
    }
    all.decision.upper_A = upper_A;
    if (all.decision.feasible && (all.decision.lower_A > upper_A)) {
        all.decision.feasible = false;
        all.decision.active = RCBF_INFEASIBLE;
        all.decision.current_A = 0.0f;
    }
    return all;
}

/* As bms_growth.c has it without a plan. A request that is no number comes last, to be refused. */
static float wanted_current_A(const pack_t *pack, float asked_A)
{
    const float allowed_A = numeric_larger(pack->calibration->reference_current_A,
                                           pack->command_A - pack->growth_A);
    return numeric_larger(allowed_A, asked_A);
}

static void follow_growth(pack_t *pack)
{
    const bms_calibration_t *calibration = pack->calibration;
    rcbf_decision_t *decision = &pack->decision.decision;
    const float growth_A = calibration->current_growth_A;
    const float most_A = numeric_smaller(growth_A, -MOST_RISE * calibration->reference_current_A);
    if (!pack_is_charging(pack) || pack->monitor.stop) {
        pack->growth_A = growth_A;
        for (uint32_t i = 0u; i < pack->cells; i++) {
            rcbf_steadier_reset(&pack->cell[i].steadier);
        }
    } else if (decision->feasible && (decision->active != RCBF_NONE)) {
        pack->limit = decision->active;
        pack->limit_cell = pack->decision.cell;
        pack->growth_A = LEAST_GROWTH * growth_A;
    } else if (decision->feasible && (decision->current_A > pack->command_A - pack->growth_A)) {
        pack->growth_A = most_A;
    } else if (decision->feasible && (pack->growth_A < most_A)) {
        decision->active = pack->limit;
        pack->decision.cell = pack->limit_cell;
        pack->state = BMS_DERATED;
        pack->growth_A = numeric_smaller(pack->growth_A + GROWTH_RISE * growth_A, most_A);
    }
}

static void decide(pack_t *pack, const pack_readings_t *readings)
{
    pack->decision = NO_DECISION;
    if (pack_is_charging(pack) && is_full(pack)) {
        pack->state = BMS_COMPLETE;
    }
    if (pack_is_charging(pack)) {
        pack->decision = decide_together(pack, readings,
                                         wanted_current_A(pack, readings->reference_current_A));
        pack->state = (pack->decision.decision.active == RCBF_NONE) ? BMS_CHARGING : BMS_DERATED;
    }
}

static void run_period(pack_t *pack, const pack_readings_t *readings)
{
    keep_coolant(pack, readings);
    uint32_t symptoms = update_cells(pack, readings);
    symptoms |= pack_bit_if(!request_is_possible(pack, readings), FAULT_REQUEST_INVALID);
    if (pack->state == BMS_INIT) {
        if (is_settling(pack)) {
            monitor_step(&pack->monitor, symptoms & ~pack_bit_if(true, FAULT_OUT_OF_DOMAIN));
            pack->state = (pack->monitor.latched != 0u) ? BMS_FAULT : BMS_INIT;
            return;
        }
        pack->state = BMS_STANDBY;
    }
    follow_request(pack, readings, symptoms);
    decide(pack, readings);
    symptoms |= pack_bit_if(!monitor_stops(symptoms) && pack_is_charging(pack) &&
                                (pack->decision.decision.active == RCBF_INVALID),
                            FAULT_DECISION_INVALID);
    monitor_step(&pack->monitor, symptoms);
    if (pack->monitor.latched != 0u) {
        pack->state = BMS_FAULT;
    }
    const bool may_charge = pack_is_charging(pack) && !pack->monitor.stop &&
                            pack->decision.decision.feasible;
    follow_growth(pack);
    /* By its roundings a family's decision may be a step of float32 stronger than what was wanted. */
    pack->command_A = may_charge ? numeric_larger(pack->calibration->reference_current_A,
                                                  pack->decision.decision.current_A)
                                 : 0.0f;
}

void pack_step(pack_t *pack, const pack_readings_t *readings)
{
    if (pack->calibration != NULL) {
        run_period(pack, readings);
    } else {
        monitor_step(&pack->monitor, pack_bit_if(true, FAULT_CALIBRATION));
        pack->state = BMS_FAULT;
    }
}

rcbf_decision_t pack_cell_decision(const pack_t *pack, const pack_readings_t *readings,
                                   uint32_t cell, float reference_current_A)
{
    if ((pack->calibration == NULL) || (cell >= pack->cells)) {
        return NO_DECISION.decision;
    }
    const pack_cell_reading_t reading = pack_cell_reading(pack, readings, cell);
    uint8_t segment = pack->cell[cell].decision_segment;
    rcbf_steadier_t none;
    rcbf_steadier_reset(&none);
    return pack_cell_decide(pack, cell, &reading, reference_current_A, &segment, &none);
}

range_t pack_soc_spread(const pack_t *pack)
{
    range_t spread = { FLT_MAX, -FLT_MAX };
    for (uint32_t i = 0u; i < pack->cells; i++) {
        spread.low = numeric_smaller(spread.low, pack->cell[i].soc.soc);
        spread.high = numeric_larger(spread.high, pack->cell[i].soc.soc);
    }
    return spread;
}
