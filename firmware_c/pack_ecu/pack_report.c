#include "pack_report.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

#include "pack_balance.h"
#include "pack_codec.h"

/* The bus carries the first half of it. */
#define PRESET_HASH_SHIFT 16u

static uint32_t number_of(uint8_t cell)
{
    return (cell == PACK_NO_CELL) ? PACK_ECU_NO_CELL : ((uint32_t)cell + 1u);
}

static uint8_t weakest_cell(const pack_t *pack)
{
    uint8_t weakest = pack->decision.cell;
    float hottest_K = -FLT_MAX;
    if (weakest != PACK_NO_CELL) {
        return weakest;
    }
    for (uint32_t i = 0u; i < pack->cells; i++) {
        if (pack->cell[i].estimate.core_temperature_K > hottest_K) {
            hottest_K = pack->cell[i].estimate.core_temperature_K;
            weakest = (uint8_t)i;
        }
    }
    return weakest;
}

static uint64_t estimate_of(const pack_ecu_t *ecu)
{
    const pack_t *pack = &ecu->pack;
    const uint8_t weakest = weakest_cell(pack);
    const pack_cell_t *cell = (weakest != PACK_NO_CELL) ? &pack->cell[weakest] : NULL;
    const float core_K = (cell != NULL) ? cell->estimate.core_temperature_K : NAN;
    const float soc = ((cell != NULL) && pack->soc_known) ? cell->soc.soc : NAN;
    const bool in_domain = (cell != NULL) && cell->estimate.in_domain;
    return pack_with_code(PACK_SIGNAL_WEAKEST_CELL, number_of(weakest)) |
           pack_with_value(PACK_SIGNAL_WEAKEST_CORE_TEMPERATURE, core_K, CODEC_NEAREST) |
           pack_with_value(PACK_SIGNAL_WEAKEST_STATE_OF_CHARGE, soc, CODEC_NEAREST) |
           pack_with_code(PACK_SIGNAL_WEAKEST_IN_DOMAIN, in_domain ? 1u : 0u);
}

static uint64_t decision_of(const pack_ecu_t *ecu)
{
    const pack_decision_t *decision = &ecu->pack.decision;
    return pack_with_code(PACK_SIGNAL_GOVERNING_CELL, number_of(decision->cell)) |
           pack_with_code(PACK_SIGNAL_GOVERNING_CONSTRAINT, (uint32_t)decision->decision.active) |
           pack_with_code(PACK_SIGNAL_FEASIBLE, decision->decision.feasible ? 1u : 0u) |
           pack_with_value(PACK_SIGNAL_LIMIT_CURRENT, decision->decision.lower_A, CODEC_NEAREST);
}

static bms_state_t state_of(const pack_ecu_t *ecu)
{
    return (ecu->monitor.latched != 0u) ? BMS_FAULT : ecu->pack.state;
}

static uint64_t diagnostics_of(const pack_ecu_t *ecu)
{
    const uint8_t faulty =
        (ecu->missing_cell != PACK_NO_CELL) ? ecu->missing_cell : ecu->pack.symptom_cell;
    return pack_with_code(PACK_SIGNAL_PACK_STATE, (uint32_t)state_of(ecu)) |
           pack_with_code(PACK_SIGNAL_FIRST_FAULT, ecu->first_fault) |
           pack_with_code(PACK_SIGNAL_FAULTY_CELL, number_of(faulty)) |
           pack_with_code(PACK_SIGNAL_ACTIVE_FAULTS,
                          ecu->monitor.active | ecu->pack.monitor.active);
}

static uint64_t identity_of(const pack_ecu_t *ecu)
{
    const bms_calibration_t *calibration = ecu->pack.calibration;
    const uint32_t model = (calibration != NULL) ? calibration->model_hash : 0u;
    const uint32_t preset = (calibration != NULL) ? calibration->preset_hash : 0u;
    return pack_with_code(PACK_SIGNAL_MODEL_HASH, model) |
           pack_with_code(PACK_SIGNAL_PRESET_HASH, preset >> PRESET_HASH_SHIFT) |
           pack_with_code(PACK_SIGNAL_CELLS, ecu->pack.cells) |
           pack_with_code(PACK_SIGNAL_NETWORK_VERSION, PACK_NETWORK_VERSION);
}

static uint64_t function_of(const pack_ecu_t *ecu)
{
    return pack_with_value(PACK_SIGNAL_ALLOWED_CURRENT_NOW, ecu->allowed_now_A,
                           CODEC_TOWARDS_ZERO) |
           pack_with_value(PACK_SIGNAL_ALLOWED_CURRENT_FOR10S, ecu->allowed_soon_A,
                           CODEC_TOWARDS_ZERO);
}

static uint64_t spread_of(const pack_ecu_t *ecu)
{
    const range_t none = { NAN, NAN };
    const range_t spread = ecu->pack.soc_known ? pack_balance_spread(ecu) : none;
    return pack_with_value(PACK_SIGNAL_HIGHEST_STATE_OF_CHARGE, spread.high, CODEC_NEAREST) |
           pack_with_value(PACK_SIGNAL_LOWEST_STATE_OF_CHARGE, spread.low, CODEC_NEAREST);
}

static uint64_t content_of(const pack_ecu_t *ecu, uint32_t message)
{
    switch (message) {
    case PACK_TRANSMITTED_ESTIMATE:
        return estimate_of(ecu);
    case PACK_TRANSMITTED_DECISION:
        return decision_of(ecu);
    case PACK_TRANSMITTED_DIAGNOSTICS:
        return diagnostics_of(ecu);
    case PACK_TRANSMITTED_FAULTS:
        return pack_with_code(PACK_SIGNAL_LATCHED_FAULTS, ecu->latched_faults);
    case PACK_TRANSMITTED_IDENTITY:
        return identity_of(ecu);
    case PACK_TRANSMITTED_FUNCTION:
        return function_of(ecu);
    case PACK_TRANSMITTED_SPREAD:
        return spread_of(ecu);
    default:
        return pack_with_value(PACK_SIGNAL_COMMAND_CURRENT, ecu->command_A, CODEC_TOWARDS_ZERO) |
               pack_with_code(PACK_SIGNAL_COMMAND_STATE, (uint32_t)state_of(ecu));
    }
}

static can_frame_t *next_frame(pack_ecu_t *ecu)
{
    can_frame_t *frame = &ecu->outbox[ecu->outbox_length];
    ecu->outbox_length++;
    return frame;
}

static void queue_page(pack_ecu_t *ecu, uint32_t group, uint32_t page)
{
    const uint32_t sent = group - PACK_GROUP_CELL_CORES;
    const pack_t *pack = &ecu->pack;
    float values[PACK_CELLS_A_PAGE];
    const uint32_t first = page * PACK_CELLS_A_PAGE;
    const uint32_t count = pack_cells_from(pack->cells, page);
    for (uint32_t i = 0u; i < count; i++) {
        const pack_cell_t *cell = &pack->cell[first + i];
        const float soc = pack->soc_known ? cell->soc.soc : NAN;
        const float bleeds = (float)ecu->bleeds[first + i];
        const float charge = (group == PACK_GROUP_CELL_CHARGES) ? soc : bleeds;
        values[i] = (group == PACK_GROUP_CELL_CORES) ? cell->estimate.core_temperature_K : charge;
    }
    can_frame_t *frame = next_frame(ecu);
    pack_fill_page(frame, group, page, values, count);
    e2e_protect(frame->data, frame->length, pack_page_message(group, page)->data_ids,
                ecu->page_counter[sent][page]);
    ecu->page_counter[sent][page]++;
}

static void queue_pages(pack_ecu_t *ecu, uint32_t group)
{
    const uint32_t pages = pack_pages(ecu->pack.cells);
    uint8_t *turn = &ecu->turn[group - PACK_GROUP_CELL_CORES];
    for (uint32_t i = 0u; (i < PACK_GROUPS[group].pages_a_period) && (i < pages); i++) {
        queue_page(ecu, group, *turn);
        *turn = (uint8_t)((*turn + 1u) % pages);
    }
}

void pack_report_queue(pack_ecu_t *ecu)
{
    ecu->outbox_length = 0u;
    ecu->outbox_next = 0u;
    queue_pages(ecu, PACK_GROUP_CELL_CORES);
    queue_pages(ecu, PACK_GROUP_CELL_CHARGES);
    queue_pages(ecu, PACK_GROUP_CELL_BLEEDS);
    for (uint32_t i = 0u; i < PACK_TRANSMITTED_COUNT; i++) {
        const codec_message_t *message = &PACK_TRANSMITTED[i];
        if ((ecu->periods % message->every_periods) != 0u) {
            continue;
        }
        can_frame_t *frame = next_frame(ecu);
        pack_fill(frame, message, content_of(ecu, i));
        if (message->is_protected != 0u) {
            e2e_protect(frame->data, frame->length, message->data_ids, ecu->counter[i]);
            ecu->counter[i]++;
        }
    }
}
