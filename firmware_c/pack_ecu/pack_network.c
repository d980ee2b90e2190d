#include "pack_network.h"

#include <math.h>

#include "numeric.h"
#include "pack_cell.h"
#include "pack_codec.h"

typedef char groups_agree[((PACK_GROUP_CELL_VOLTAGES == 0) && (PACK_GROUP_CELL_TEMPERATURES == 1) &&
                           (PACK_GROUP_PLUG_IN_CHARGES == 2))
                              ? 1
                              : -1];

static uint32_t bit_if(bool condition, fault_t fault)
{
    return condition ? ((uint32_t)1u << (uint32_t)fault) : 0u;
}

/* Values that a group has in this pack: one for each thermistor, or for each cell. */
static uint32_t count_of(const pack_ecu_t *ecu, uint32_t group)
{
    return (group == PACK_GROUP_CELL_TEMPERATURES) ? ecu->pack.thermistors : ecu->pack.cells;
}

static float *values_of(pack_ecu_t *ecu, uint32_t group)
{
    switch (group) {
    case PACK_GROUP_CELL_VOLTAGES:
        return ecu->voltage_V;
    case PACK_GROUP_CELL_TEMPERATURES:
        return ecu->surface_temperature_K;
    default:
        return ecu->plug_in_soc;
    }
}

/* A value beyond the last one is of a sender that takes the pack for another. */
static void read_page(pack_ecu_t *ecu, uint32_t group, uint32_t page, const can_frame_t *frame)
{
    float *values = &values_of(ecu, group)[page * PACK_CELLS_A_PAGE];
    const uint32_t count = pack_cells_from(count_of(ecu, group), page);
    for (uint32_t place = 0u; place < count; place++) {
        values[place] = pack_page_value(group, frame, place);
    }
    for (uint32_t place = count; place < PACK_CELLS_A_PAGE; place++) {
        if (!isnan(pack_page_value(group, frame, place))) {
            ecu->is_disturbed = true;
        }
    }
    if (group == PACK_GROUP_PLUG_IN_CHARGES) {
        ecu->plug_in_age[page] = 0u;
    }
}

static bool receive_page(pack_ecu_t *ecu, uint32_t group, const can_frame_t *frame)
{
    uint32_t page;
    if (!pack_page_of(group, frame, &page)) {
        return false;
    }
    if (page * PACK_CELLS_A_PAGE >= count_of(ecu, group)) {
        ecu->is_disturbed = true;
        return true;
    }
    const codec_message_t *message = pack_page_message(group, page);
    if (e2e_check(&ecu->page[group][page], frame->data, frame->length, message->length,
                  message->data_ids, message->policy.max_delta_counter) == E2E_OK) {
        read_page(ecu, group, page, frame);
    }
    return true;
}

/* Counts of a counter that wraps around. */
static uint8_t steps_between(uint8_t from, uint8_t to)
{
    return (uint8_t)((to - from) & (E2E_COUNTERS - 1u));
}

/* A frame stands for the ones lost before it too, but for those of a sender that starts anew. */
static void count_periods(pack_ecu_t *ecu, uint8_t last, uint8_t now)
{
    const uint8_t steps = steps_between(last, now);
    const uint8_t most = PACK_RECEIVED[PACK_RECEIVED_ELECTRICAL].policy.max_delta_counter;
    const uint8_t periods = (steps <= most) ? steps : 1u;
    if (ecu->measured_periods <= UINT8_MAX - periods) {
        ecu->measured_periods = (uint8_t)(ecu->measured_periods + periods);
    }
}

static void read_message(pack_ecu_t *ecu, uint32_t index, uint64_t bits)
{
    switch (index) {
    case PACK_RECEIVED_ELECTRICAL:
        ecu->current_A = pack_value(bits, PACK_SIGNAL_PACK_CURRENT);
        ecu->pack_voltage_V = pack_value(bits, PACK_SIGNAL_PACK_VOLTAGE);
        break;
    case PACK_RECEIVED_COOLANT:
        ecu->coolant_in_K = pack_value(bits, PACK_SIGNAL_COOLANT_IN_TEMPERATURE);
        ecu->coolant_out_K = pack_value(bits, PACK_SIGNAL_COOLANT_OUT_TEMPERATURE);
        ecu->cooling_power_W = pack_value(bits, PACK_SIGNAL_CELL_COOLING_POWER);
        break;
    default:
        ecu->request = (uint8_t)pack_code(bits, PACK_SIGNAL_REQUEST);
        ecu->reference_current_A = pack_value(bits, PACK_SIGNAL_REFERENCE_CURRENT);
        ecu->cells_in_series = (uint8_t)pack_code(bits, PACK_SIGNAL_CELLS_IN_SERIES);
        break;
    }
}

void pack_network_receive(pack_ecu_t *ecu, const can_frame_t *frame)
{
    for (uint32_t group = 0u; group < PACK_ECU_RECEIVED; group++) {
        if (receive_page(ecu, group, frame)) {
            return;
        }
    }
    for (uint32_t i = 0u; i < PACK_RECEIVED_COUNT; i++) {
        const codec_message_t *message = &PACK_RECEIVED[i];
        if (frame->id != message->id) {
            continue;
        }
        const uint8_t counter = ecu->receiver[i].counter;
        if (e2e_check(&ecu->receiver[i], frame->data, frame->length, message->length,
                      message->data_ids, message->policy.max_delta_counter) == E2E_OK) {
            read_message(ecu, i, pack_bits(frame));
            if (i == PACK_RECEIVED_ELECTRICAL) {
                count_periods(ecu, counter, ecu->receiver[i].counter);
            }
        }
        return;
    }
}

static void forget_page(pack_ecu_t *ecu, uint32_t group, uint32_t page)
{
    float *values = &values_of(ecu, group)[page * PACK_CELLS_A_PAGE];
    const uint32_t count = pack_cells_from(count_of(ecu, group), page);
    for (uint32_t place = 0u; place < count; place++) {
        values[place] = NAN;
    }
}

/* Cell that a value of a group is of. */
static uint8_t cell_of(const pack_ecu_t *ecu, uint32_t group, uint32_t index)
{
    uint8_t cell = (uint8_t)index;
    if (group == PACK_GROUP_CELL_TEMPERATURES) {
        for (uint32_t i = 0u; i < ecu->pack.cells; i++) {
            if (ecu->pack.cell[i].thermistor == index) {
                cell = (uint8_t)i;
            }
        }
    }
    return cell;
}

/* The messages of a period count together. One that has fallen behind in a queue since the charge
 * began is of the past, though none of its frames is missing. */
static bool is_late(const pack_ecu_t *ecu, uint8_t *phase, uint8_t counter)
{
    const uint8_t now = ecu->receiver[PACK_RECEIVED_ELECTRICAL].counter;
    const uint8_t ahead = steps_between(now, counter);
    if (!ecu->is_usable[PACK_RECEIVED_ELECTRICAL]) {
        return false;
    }
    if (!pack_is_charging(&ecu->pack)) {
        *phase = ahead;
    }
    return ahead != *phase;
}

static void judge_messages(pack_ecu_t *ecu)
{
    for (uint32_t i = 0u; i < PACK_RECEIVED_COUNT; i++) {
        const e2e_verdict_t verdict = e2e_supervise(&ecu->receiver[i], &PACK_RECEIVED[i].policy);
        ecu->is_usable[i] = verdict.is_usable;
        ecu->is_disturbed = ecu->is_disturbed || verdict.is_disturbed;
    }
    for (uint32_t i = 0u; i < PACK_RECEIVED_COUNT; i++) {
        if (ecu->is_usable[i] &&
            is_late(ecu, &ecu->message_phase[i], ecu->receiver[i].counter)) {
            ecu->is_usable[i] = false;
        }
    }
}

static void judge_pages(pack_ecu_t *ecu, uint32_t group)
{
    const uint32_t pages = pack_pages(count_of(ecu, group));
    ecu->is_page_missing[group] = false;
    for (uint32_t page = 0u; page < pages; page++) {
        const e2e_verdict_t verdict =
            e2e_supervise(&ecu->page[group][page], &pack_page_message(group, page)->policy);
        ecu->is_disturbed = ecu->is_disturbed || verdict.is_disturbed;
        if (!verdict.is_usable ||
            is_late(ecu, &ecu->phase[group][page], ecu->page[group][page].counter)) {
            ecu->is_page_missing[group] = true;
            forget_page(ecu, group, page);
            if (ecu->missing_cell == PACK_NO_CELL) {
                ecu->missing_cell = cell_of(ecu, group, page * PACK_CELLS_A_PAGE);
            }
        }
    }
}

static void age_plug_in_pages(pack_ecu_t *ecu)
{
    const uint32_t pages = pack_pages(ecu->pack.cells);
    for (uint32_t page = 0u; page < pages; page++) {
        e2e_receiver_t *receiver = &ecu->page[PACK_GROUP_PLUG_IN_CHARGES][page];
        ecu->is_disturbed = ecu->is_disturbed || receiver->is_disturbed;
        receiver->is_disturbed = false;
        if (ecu->plug_in_age[page] > PACK_GROUPS[PACK_GROUP_PLUG_IN_CHARGES].timeout_periods) {
            forget_page(ecu, PACK_GROUP_PLUG_IN_CHARGES, page);
        } else {
            ecu->plug_in_age[page]++;
        }
    }
}

void pack_network_forget_plug_in(pack_ecu_t *ecu)
{
    for (uint32_t page = 0u; page < pack_pages(ecu->pack.cells); page++) {
        ecu->plug_in_age[page] = UINT8_MAX;
        forget_page(ecu, PACK_GROUP_PLUG_IN_CHARGES, page);
    }
}

void pack_network_step(pack_ecu_t *ecu)
{
    ecu->missing_cell = PACK_NO_CELL;
    judge_messages(ecu);
    for (uint32_t group = 0u; group < PACK_ECU_SUPERVISED; group++) {
        judge_pages(ecu, group);
    }
    age_plug_in_pages(ecu);
    if (!ecu->is_usable[PACK_RECEIVED_COOLANT]) {
        ecu->coolant_in_K = NAN;
        ecu->coolant_out_K = NAN;
        ecu->cooling_power_W = NAN;
    }
}

static bool pages_are(const pack_ecu_t *ecu, uint32_t group)
{
    for (uint32_t page = 0u; page < pack_pages(count_of(ecu, group)); page++) {
        if (ecu->page[group][page].state != E2E_VALID) {
            return false;
        }
    }
    return true;
}

bool pack_network_is_valid(const pack_ecu_t *ecu)
{
    bool is_valid = true;
    for (uint32_t i = 0u; i < PACK_RECEIVED_COUNT; i++) {
        is_valid = is_valid && (ecu->receiver[i].state == E2E_VALID);
    }
    for (uint32_t group = 0u; group < PACK_ECU_SUPERVISED; group++) {
        is_valid = is_valid && pages_are(ecu, group);
    }
    return is_valid;
}

/* The cells' voltages are those of one string: together they are the pack's. */
static bool sum_deviates(const pack_ecu_t *ecu)
{
    float sum_V = 0.0f;
    for (uint32_t i = 0u; i < ecu->pack.cells; i++) {
        sum_V += ecu->voltage_V[i];
    }
    return !(fabsf(sum_V - ecu->pack_voltage_V) <= ecu->pack_voltage_error_V);
}

static bool request_is_wrong(const pack_ecu_t *ecu)
{
    return ((ecu->request != REQUEST_OFF) && (ecu->request != REQUEST_CHARGE)) ||
           (ecu->cells_in_series != ecu->pack.cells);
}

uint32_t pack_network_symptoms(const pack_ecu_t *ecu)
{
    const bool is_electrical = ecu->is_usable[PACK_RECEIVED_ELECTRICAL] &&
                               !ecu->is_page_missing[PACK_GROUP_CELL_VOLTAGES];
    return bit_if(!is_electrical, FAULT_ELECTRICAL_MISSING) |
           bit_if(ecu->is_page_missing[PACK_GROUP_CELL_TEMPERATURES], FAULT_THERMAL_MISSING) |
           bit_if(!ecu->is_usable[PACK_RECEIVED_COOLANT], FAULT_COOLANT_MISSING) |
           bit_if(!ecu->is_usable[PACK_RECEIVED_REQUEST], FAULT_REQUEST_MISSING) |
           bit_if(ecu->is_usable[PACK_RECEIVED_REQUEST] && request_is_wrong(ecu),
                  FAULT_REQUEST_INVALID) |
           bit_if(is_electrical && sum_deviates(ecu), FAULT_VOLTAGE_RANGE) |
           bit_if(ecu->is_disturbed, FAULT_CORRUPTED_FRAMES) |
           bit_if(pace_is_lost(&ecu->pace), FAULT_OUT_OF_STEP);
}
