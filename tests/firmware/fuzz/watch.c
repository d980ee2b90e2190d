#include "watch.h"

#include <math.h>

#include "can_db.h"
#include "input.h"
#include "session.h"

#define RESOLUTION_A 1e-3f
#define DIAGNOSTICS_FAULTS 0xFFFFFu

/* Faults whose symptom alone forbids current, as docs/safety/fmea.md has them: all but deviations
 * of current and voltage (11, 12) and refused frames (16). */
#define STOPPING (DIAGNOSTICS_FAULTS & ~(1u << 11u) & ~(1u << 12u) & ~(1u << 16u))

void watch_begin(watch_t *watch, const bms_calibration_t *calibration)
{
    *watch = (watch_t){ 0 };
    if (calibration != NULL) {
        const plausibility_t *limits = &calibration->plausibility;
        watch->limits = (watch_limits_t){
            .reference_current_A = calibration->reference_current_A,
            .growth_A = calibration->current_growth_A,
            .highest_surface_K = calibration->rcbf.max_surface_temperature_K.high_K +
                                 limits->temperature_overshoot_K,
            .highest_voltage_V = calibration->rcbf.max_voltage_V + limits->voltage_overshoot_V,
        };
    }
}

static bool is_number(uint32_t signal, uint32_t raw)
{
    return raw <= CAN_SIGNALS[signal].raw_max;
}

static float value(uint32_t signal, uint32_t raw)
{
    return codec_decode(&CAN_SIGNALS[signal], raw);
}

static bool electrical_allows(const watch_t *watch, const can_frame_t *frame)
{
    struct can_db_cell_electrical_t m;
    (void)can_db_cell_electrical_unpack(&m, frame->data, frame->length);
    return is_number(CAN_SIGNAL_CURRENT, m.current) && is_number(CAN_SIGNAL_VOLTAGE, m.voltage) &&
           (value(CAN_SIGNAL_VOLTAGE, m.voltage) <= watch->limits.highest_voltage_V);
}

static bool thermal_allows(const watch_t *watch, const can_frame_t *frame)
{
    struct can_db_cell_thermal_t m;
    (void)can_db_cell_thermal_unpack(&m, frame->data, frame->length);
    return is_number(CAN_SIGNAL_SURFACE_TEMPERATURE, m.surface_temperature) &&
           is_number(CAN_SIGNAL_COOLANT_TEMPERATURE, m.coolant_temperature) &&
           (value(CAN_SIGNAL_SURFACE_TEMPERATURE, m.surface_temperature) <=
            watch->limits.highest_surface_K);
}

static bool coolant_allows(const can_frame_t *frame)
{
    struct can_db_coolant_t m;
    (void)can_db_coolant_unpack(&m, frame->data, frame->length);
    return is_number(CAN_SIGNAL_COOLING_POWER, m.cooling_power);
}

static bool request_allows(watch_t *watch, const can_frame_t *frame)
{
    struct can_db_charge_request_t m;
    (void)can_db_charge_request_unpack(&m, frame->data, frame->length);
    watch->was_off = watch->was_off || (m.request == (uint8_t)REQUEST_OFF);
    if ((m.request != (uint8_t)REQUEST_CHARGE) ||
        !is_number(CAN_SIGNAL_REFERENCE_CURRENT, m.reference_current)) {
        return false;
    }
    const float asked_A = value(CAN_SIGNAL_REFERENCE_CURRENT, m.reference_current);
    if (asked_A < watch->strongest_asked_A) {
        watch->strongest_asked_A = asked_A;
    }
    return asked_A <= 0.0f;
}

void watch_frame(watch_t *watch, const can_frame_t *frame)
{
    for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
        const codec_message_t *message = &CAN_RECEIVED[i];
        if ((frame->id != message->id) || (frame->length != message->length) ||
            (frame->data[0] != e2e_crc(frame->data, frame->length, message->data_ids))) {
            continue;
        }
        bool allows = true;
        if (i == CAN_RECEIVED_CELL_ELECTRICAL) {
            allows = electrical_allows(watch, frame);
        } else if (i == CAN_RECEIVED_CELL_THERMAL) {
            allows = thermal_allows(watch, frame);
        } else if (i == CAN_RECEIVED_COOLANT) {
            allows = coolant_allows(frame);
        } else if (i == CAN_RECEIVED_CHARGE_REQUEST) {
            allows = request_allows(watch, frame);
        }
        watch->messages[i].intact++;
        watch->messages[i].usable += allows ? 1u : 0u;
    }
}

static void hold_command(watch_t *watch, const struct can_db_charge_command_t *m)
{
    MUST(is_number(CAN_SIGNAL_COMMAND_CURRENT, m->command_current), "the command is no number");
    const float command_A = value(CAN_SIGNAL_COMMAND_CURRENT, m->command_current);
    const bool is_charging =
        (m->command_state == (uint8_t)BMS_CHARGING) || (m->command_state == (uint8_t)BMS_DERATED);
    const bool has_current = fabsf(command_A) > RESOLUTION_A;
    MUST(m->command_state <= (uint8_t)BMS_FAULT, "the state is none");
    MUST(command_A <= RESOLUTION_A, "current that discharges");
    MUST(command_A >= watch->limits.reference_current_A - RESOLUTION_A,
         "current beyond the calibration's strongest");
    MUST(!has_current || is_charging, "current without a charge");
    if (is_charging && !watch->was_charging) {
        MUST(watch->was_off, "a charge begins whose request was never off");
    }
    watch->was_off = watch->was_off && !is_charging;
    watch->was_charging = is_charging;
    if (has_current) {
        MUST(watch->latched == 0u, "current while faulted");
        MUST(command_A >= watch->command_A - watch->limits.growth_A - 2.0f * RESOLUTION_A,
             "current grows faster than the calibration allows");
        MUST(watch->messages[CAN_RECEIVED_CHARGE_REQUEST].usable > 0u,
             "current without a request");
        MUST(command_A >= watch->strongest_asked_A - RESOLUTION_A,
             "current stronger than any request asks for");
        MUST(watch->messages[CAN_RECEIVED_CELL_ELECTRICAL].usable > 0u,
             "current with electrical readings that are missing, no numbers or too high");
        MUST(watch->messages[CAN_RECEIVED_CELL_THERMAL].usable > 0u,
             "current with thermal readings that are missing, no numbers or too high");
        MUST(watch->messages[CAN_RECEIVED_COOLANT].usable > 0u,
             "current with a cooling power that is missing or no number");
    }
    watch->command_A = command_A;
}

static void hold_counter(watch_t *watch, const can_frame_t *frame)
{
    const uint8_t counter = frame->data[1] & 15u;
    const codec_message_t *message = &CAN_TRANSMITTED[CAN_TRANSMITTED_CHARGE_COMMAND];
    MUST(frame->data[0] == e2e_crc(frame->data, frame->length, message->data_ids),
         "a command with a wrong CRC");
    MUST(!watch->has_counter || (counter == ((watch->counter + 1u) & 15u)),
         "a command whose counter does not follow the last one");
    watch->has_counter = true;
    watch->counter = counter;
}

void watch_sent(watch_t *watch, const can_frame_t *frame)
{
    MUST((frame->id <= 0x7FFu) && (frame->length <= 8u), "a frame that is none");
    if (frame->id == CAN_DB_DIAGNOSTICS_FRAME_ID) {
        struct can_db_diagnostics_t m;
        (void)can_db_diagnostics_unpack(&m, frame->data, frame->length);
        watch->latched = m.latched_faults | (m.active_faults & STOPPING);
    } else if (frame->id == CAN_DB_CHARGE_COMMAND_FRAME_ID) {
        struct can_db_charge_command_t m;
        (void)can_db_charge_command_unpack(&m, frame->data, frame->length);
        hold_counter(watch, frame);
        hold_command(watch, &m);
    }
}

void watch_end_period(watch_t *watch, const can_frame_t *last)
{
    MUST(last->id == CAN_DB_CHARGE_COMMAND_FRAME_ID, "the command is not the last frame");
    memset(watch->messages, 0, sizeof watch->messages);
    watch->strongest_asked_A = 0.0f;
}

float watch_step(watch_t *watch, bms_t *bms)
{
    can_frame_t frame = { 0 };
    uint32_t sent = 0u;
    bms_step(bms);
    while (bms_transmit(bms, &frame)) {
        watch_sent(watch, &frame);
        sent++;
    }
    MUST(sent <= BMS_TRANSMITTED_MESSAGES, "more frames than messages");
    watch_end_period(watch, &frame);
    return watch->command_A;
}
