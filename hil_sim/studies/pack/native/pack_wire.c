#include "pack_wire.h"

#include <math.h>

#include "pack_codec.h"

static void protect(can_frame_t *frame, const codec_message_t *message, uint8_t *counter)
{
    e2e_protect(frame->data, frame->length, message->data_ids, *counter);
    (*counter)++;
}

static void publish_message(pack_wire_t *wire, uint32_t index, uint64_t bits, can_frame_t *frame)
{
    pack_fill(frame, &PACK_RECEIVED[index], bits);
    protect(frame, &PACK_RECEIVED[index], &wire->counter[index]);
}

static void publish_page(pack_wire_t *wire, uint32_t group, uint32_t page, const float *values,
                         uint32_t cells, can_frame_t *frame)
{
    pack_fill_page(frame, group, page, &values[page * PACK_CELLS_A_PAGE],
                   pack_cells_from(cells, page));
    protect(frame, pack_page_message(group, page), &wire->page_counter[group][page]);
}

uint32_t pack_wire_publish(pack_wire_t *wire, const pack_measured_t *measured, float pack_voltage_V,
                           uint32_t thermistors, const pack_asked_t *asked, can_frame_t *frames)
{
    uint32_t count = 0u;
    publish_message(
        wire, PACK_RECEIVED_ELECTRICAL,
        pack_with_value(PACK_SIGNAL_PACK_CURRENT, measured->current_A, CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_PACK_VOLTAGE, pack_voltage_V, CODEC_NEAREST),
        &frames[count++]);
    publish_message(
        wire, PACK_RECEIVED_COOLANT,
        pack_with_value(PACK_SIGNAL_COOLANT_IN_TEMPERATURE, measured->coolant_in_K,
                        CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_COOLANT_OUT_TEMPERATURE, measured->coolant_out_K,
                            CODEC_NEAREST) |
            pack_with_value(PACK_SIGNAL_CELL_COOLING_POWER, measured->cooling_power_W,
                            CODEC_NEAREST),
        &frames[count++]);
    publish_message(
        wire, PACK_RECEIVED_REQUEST,
        pack_with_code(PACK_SIGNAL_REQUEST, asked->request) |
            pack_with_value(PACK_SIGNAL_REFERENCE_CURRENT, asked->reference_current_A,
                            CODEC_NEAREST) |
            pack_with_code(PACK_SIGNAL_CELLS_IN_SERIES, asked->cells),
        &frames[count++]);
    for (uint32_t page = 0u; page < pack_pages(asked->cells); page++) {
        publish_page(wire, PACK_GROUP_CELL_VOLTAGES, page, measured->voltage_V, asked->cells,
                     &frames[count++]);
    }
    for (uint32_t page = 0u; page < pack_pages(thermistors); page++) {
        publish_page(wire, PACK_GROUP_CELL_TEMPERATURES, page, measured->surface_temperature_K,
                     thermistors, &frames[count++]);
    }
    const uint32_t pages = pack_pages(asked->cells);
    const uint32_t turns = PACK_GROUPS[PACK_GROUP_PLUG_IN_CHARGES].pages_a_period;
    for (uint32_t i = 0u; (i < turns) && (i < pages); i++) {
        publish_page(wire, PACK_GROUP_PLUG_IN_CHARGES, wire->turn, asked->plug_in_soc,
                     asked->cells, &frames[count++]);
        wire->turn = (wire->turn + 1u) % pages;
    }
    return count;
}

static bool is_intact(const can_frame_t *frame, const codec_message_t *message)
{
    return (frame->id == message->id) && (frame->length == message->length) &&
           ((message->is_protected == 0u) ||
            (frame->data[0] == e2e_crc(frame->data, frame->length, message->data_ids)));
}

static void hear_message(pack_heard_t *heard, uint32_t index, uint64_t bits)
{
    switch (index) {
    case PACK_TRANSMITTED_ESTIMATE:
        heard->weakest_cell = (uint8_t)pack_code(bits, PACK_SIGNAL_WEAKEST_CELL);
        heard->weakest_core_K = pack_value(bits, PACK_SIGNAL_WEAKEST_CORE_TEMPERATURE);
        heard->weakest_soc = pack_value(bits, PACK_SIGNAL_WEAKEST_STATE_OF_CHARGE);
        break;
    case PACK_TRANSMITTED_DECISION:
        heard->governing_cell = (uint8_t)pack_code(bits, PACK_SIGNAL_GOVERNING_CELL);
        heard->constraint = (uint8_t)pack_code(bits, PACK_SIGNAL_GOVERNING_CONSTRAINT);
        heard->feasible = (uint8_t)pack_code(bits, PACK_SIGNAL_FEASIBLE);
        heard->limit_A = pack_value(bits, PACK_SIGNAL_LIMIT_CURRENT);
        break;
    case PACK_TRANSMITTED_DIAGNOSTICS:
        heard->first_fault = (uint8_t)pack_code(bits, PACK_SIGNAL_FIRST_FAULT);
        heard->faulty_cell = (uint8_t)pack_code(bits, PACK_SIGNAL_FAULTY_CELL);
        heard->active_faults = pack_code(bits, PACK_SIGNAL_ACTIVE_FAULTS);
        break;
    case PACK_TRANSMITTED_FAULTS:
        heard->latched_faults = pack_code(bits, PACK_SIGNAL_LATCHED_FAULTS);
        break;
    case PACK_TRANSMITTED_FUNCTION:
        heard->allowed_now_A = pack_value(bits, PACK_SIGNAL_ALLOWED_CURRENT_NOW);
        heard->allowed_soon_A = pack_value(bits, PACK_SIGNAL_ALLOWED_CURRENT_FOR10S);
        break;
    case PACK_TRANSMITTED_SPREAD:
        heard->highest_soc = pack_value(bits, PACK_SIGNAL_HIGHEST_STATE_OF_CHARGE);
        heard->lowest_soc = pack_value(bits, PACK_SIGNAL_LOWEST_STATE_OF_CHARGE);
        break;
    case PACK_TRANSMITTED_IDENTITY:
        heard->model_hash = pack_code(bits, PACK_SIGNAL_MODEL_HASH);
        heard->preset_hash = pack_code(bits, PACK_SIGNAL_PRESET_HASH);
        heard->cells = (uint8_t)pack_code(bits, PACK_SIGNAL_CELLS);
        heard->network_version = (uint8_t)pack_code(bits, PACK_SIGNAL_NETWORK_VERSION);
        break;
    default:
        heard->command_A = pack_value(bits, PACK_SIGNAL_COMMAND_CURRENT);
        heard->state = (uint8_t)pack_code(bits, PACK_SIGNAL_COMMAND_STATE);
        break;
    }
}

static void hear_page(pack_heard_t *heard, uint32_t group, const can_frame_t *frame)
{
    uint32_t page;
    if (!pack_page_of(group, frame, &page) || !is_intact(frame, pack_page_message(group, page))) {
        return;
    }
    float *values = (group == PACK_GROUP_CELL_CORES) ? heard->core_K : heard->soc;
    for (uint32_t place = 0u; place < PACK_CELLS_A_PAGE; place++) {
        const uint32_t cell = page * PACK_CELLS_A_PAGE + place;
        if (cell < BMS_MAX_CELLS) {
            values[cell] = pack_page_value(group, frame, place);
        }
    }
}

/* Only a page that is intact and in sequence switches anything on, and not for long. */
static void hear_bleeds(pack_wire_t *wire, pack_heard_t *heard, const can_frame_t *frame)
{
    uint32_t page;
    if (!pack_page_of(PACK_GROUP_CELL_BLEEDS, frame, &page)) {
        return;
    }
    const codec_message_t *message = pack_page_message(PACK_GROUP_CELL_BLEEDS, page);
    if (e2e_check(&wire->bleed_page[page], frame->data, frame->length, message->length,
                  message->data_ids, message->policy.max_delta_counter) != E2E_OK) {
        return;
    }
    wire->bleed_age[page] = 0u;
    for (uint32_t place = 0u; place < PACK_CELLS_A_PAGE; place++) {
        const uint32_t cell = page * PACK_CELLS_A_PAGE + place;
        if (cell < BMS_MAX_CELLS) {
            heard->bleeds[cell] =
                pack_page_value(PACK_GROUP_CELL_BLEEDS, frame, place) >= 0.5f;
        }
    }
}

static void age_bleeds(pack_wire_t *wire, pack_heard_t *heard)
{
    for (uint32_t cell = 0u; cell < BMS_MAX_CELLS; cell++) {
        const uint32_t page = cell / PACK_CELLS_A_PAGE;
        if (wire->bleed_age[page] >= PACK_BLEED_PERIODS) {
            heard->bleeds[cell] = false;
        } else if (cell % PACK_CELLS_A_PAGE == 0u) {
            wire->bleed_age[page]++;
        }
    }
}

void pack_wire_bleed(const pack_heard_t *heard, plant_t *plant)
{
    for (uint32_t i = 0u; i < plant->cells; i++) {
        plant->cell[i].bleeds = heard->bleeds[i] && (plant->bleed_ohm > 0.0);
    }
}

static void hear_command(pack_wire_t *wire, const can_frame_t *frame, pack_heard_t *heard)
{
    const codec_message_t *message = &PACK_TRANSMITTED[PACK_TRANSMITTED_COMMAND];
    if (e2e_check(&wire->command, frame->data, frame->length, message->length, message->data_ids,
                  message->policy.max_delta_counter) == E2E_OK) {
        hear_message(heard, PACK_TRANSMITTED_COMMAND, pack_bits(frame));
    }
}

void pack_wire_hear(pack_wire_t *wire, const can_frame_t *frames, uint32_t count,
                    pack_heard_t *heard)
{
    const codec_message_t *command = &PACK_TRANSMITTED[PACK_TRANSMITTED_COMMAND];
    uint32_t commands = 0u;
    heard->command_A = NAN;
    heard->state = UINT8_MAX;
    age_bleeds(wire, heard);
    for (uint32_t n = 0u; n < count; n++) {
        const can_frame_t *frame = &frames[n];
        if (frame->id == command->id) {
            hear_command(wire, frame, heard);
            commands += is_intact(frame, command) ? 1u : 0u;
            continue;
        }
        hear_bleeds(wire, heard, frame);
        hear_page(heard, PACK_GROUP_CELL_CORES, frame);
        hear_page(heard, PACK_GROUP_CELL_CHARGES, frame);
        for (uint32_t i = 0u; i < PACK_TRANSMITTED_COMMAND; i++) {
            if (is_intact(frame, &PACK_TRANSMITTED[i])) {
                hear_message(heard, i, pack_bits(frame));
            }
        }
    }
    const e2e_verdict_t verdict = e2e_supervise(&wire->command, &command->policy);
    heard->is_contested = commands > 1u;
    if (!verdict.is_usable || heard->is_contested) {
        heard->command_A = NAN;
    }
}

uint32_t pack_wire_exchange(pack_ecu_t *ecu, const can_frame_t *frames, uint32_t count,
                            can_frame_t *sent)
{
    uint32_t sends = 0u;
    for (uint32_t n = 0u; n < count; n++) {
        pack_ecu_receive(ecu, &frames[n]);
    }
    pack_ecu_step(ecu);
    while (pack_ecu_transmit(ecu, &sent[sends])) {
        sends++;
    }
    return sends;
}

uint32_t pack_command_id(void)
{
    return PACK_TRANSMITTED[PACK_TRANSMITTED_COMMAND].id;
}
