#include "ecu_link.h"

#include <math.h>

#include "can_catalog.h"
#include "can_db.h"

/* Times of the modes, in s: the longest that is sent, and what says that there is none. */
#define LONGEST_TIME_S 65533.0
#define TIME_NOT_AVAILABLE 65535u

static double raw_of(const link_signal_t *signal, double value)
{
    const double steps = value / signal->scale - signal->offset_steps;
    return rint(fmin(fmax(steps, signal->lowest), signal->highest));
}

static double value_of(const link_signal_t *signal, double raw)
{
    return (raw + signal->offset_steps) * signal->scale;
}

double link_over_the_bus(const link_signal_t *signal, double value)
{
    return value_of(signal, raw_of(signal, value));
}

static void send(link_t *link, uint32_t index, can_frame_t *frame)
{
    const codec_message_t *message = &CAN_RECEIVED[index];
    frame->id = message->id;
    frame->length = message->length;
    e2e_protect(frame->data, frame->length, message->data_ids, link->counter);
    bms_receive(&link->bms, frame);
}

static void send_readings(link_t *link, const link_signals_t *signals,
                          const double readings[LINK_READINGS])
{
    uint32_t raw[LINK_READINGS];
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        raw[i] = (uint32_t)raw_of(&signals->readings[i], readings[i]);
    }
    can_frame_t frame = { 0 };
    const struct can_db_cell_electrical_t electrical = { .current = raw[0],
                                                         .voltage = (uint16_t)raw[1] };
    (void)can_db_cell_electrical_pack(frame.data, &electrical, sizeof frame.data);
    send(link, CAN_RECEIVED_CELL_ELECTRICAL, &frame);
    const struct can_db_cell_thermal_t thermal = { .surface_temperature = (uint16_t)raw[2],
                                                   .coolant_temperature = (uint16_t)raw[3] };
    (void)can_db_cell_thermal_pack(frame.data, &thermal, sizeof frame.data);
    send(link, CAN_RECEIVED_CELL_THERMAL, &frame);
    const struct can_db_coolant_t coolant = { .cooling_power = (uint16_t)raw[4] };
    (void)can_db_coolant_pack(frame.data, &coolant, sizeof frame.data);
    send(link, CAN_RECEIVED_COOLANT, &frame);
}

static void send_mode(link_t *link, const link_request_t *asked)
{
    can_frame_t frame = { 0 };
    const struct can_db_charge_mode_t mode = {
        .mode = (uint8_t)asked->mode,
        .time_to_full = (asked->time_to_full_s < 0.0)
                            ? TIME_NOT_AVAILABLE
                            : (uint16_t)rint(fmin(asked->time_to_full_s, LONGEST_TIME_S)),
    };
    (void)can_db_charge_mode_pack(frame.data, &mode, sizeof frame.data);
    send(link, CAN_RECEIVED_CHARGE_MODE, &frame);
}

/* Time to full of a frame with the plan; negative where it has none. */
static double predicted_s(link_t *link, const can_frame_t *frame)
{
    const codec_message_t *message = &CAN_TRANSMITTED[CAN_TRANSMITTED_PLAN];
    if (e2e_check(&link->plan_e2e, frame->data, frame->length, message->length, message->data_ids,
                  1u) != E2E_OK) {
        return -1.0;
    }
    struct can_db_plan_t plan;
    (void)can_db_plan_unpack(&plan, frame->data, frame->length);
    const double told_s = (double)plan.predicted_time_to_full;
    return (told_s <= LONGEST_TIME_S) ? told_s : -1.0;
}

static link_answer_t hear(link_t *link, const link_signals_t *signals)
{
    const codec_message_t *message = &CAN_TRANSMITTED[CAN_TRANSMITTED_CHARGE_COMMAND];
    link_answer_t answer = { false, 0.0, BMS_INIT, -1.0 };
    can_frame_t frame;
    while (bms_transmit(&link->bms, &frame)) {
        if (frame.id == CAN_TRANSMITTED[CAN_TRANSMITTED_PLAN].id) {
            answer.predicted_s = predicted_s(link, &frame);
            continue;
        }
        if ((frame.id != message->id) ||
            (e2e_check(&link->command_e2e, frame.data, frame.length, message->length,
                       message->data_ids, 1u) != E2E_OK)) {
            continue;
        }
        struct can_db_charge_command_t command;
        (void)can_db_charge_command_unpack(&command, frame.data, frame.length);
        const link_signal_t *signal = &signals->command_current;
        answer.intact = (double)command.command_current <= signal->highest;
        answer.command_A = value_of(signal, command.command_current);
        answer.state = command.command_state;
    }
    return answer;
}

link_answer_t link_exchange(link_t *link, const link_signals_t *signals,
                            const double readings[LINK_READINGS], const link_request_t *asked)
{
    send_readings(link, signals, readings);
    can_frame_t frame = { 0 };
    const struct can_db_charge_request_t request = {
        .request = asked->charge ? REQUEST_CHARGE : REQUEST_OFF,
        .reference_current =
            (uint32_t)raw_of(&signals->reference_current, asked->reference_current_A),
        .plug_in_state_of_charge = (uint16_t)raw_of(&signals->plug_in_soc, asked->plug_in_soc),
    };
    (void)can_db_charge_request_pack(frame.data, &request, sizeof frame.data);
    send(link, CAN_RECEIVED_CHARGE_REQUEST, &frame);
    if (asked->has_mode) {
        send_mode(link, asked);
    }
    link->counter++;
    bms_step(&link->bms);
    return hear(link, signals);
}
