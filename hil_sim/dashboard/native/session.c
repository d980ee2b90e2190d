#include "session.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "can_catalog.h"

#define COUNTER_MASK 0x0Fu

static double within(double value, double low, double high)
{
    return (value < low) ? low : ((value > high) ? high : value);
}

void session_start_ecu(session_t *session)
{
    const bms_config_t config = { .calibration = &session->scenario->calibration };
    const bms_start_t start = {
        .calibration_content = session->scenario->calibration_content,
    };
    bms_init(&session->bms, &config);
    bms_tell_start(&session->bms, &start);
}

static void age(cell_t *cell, const session_settings_t *settings)
{
    cell->capacity_As *= settings->capacity_factor;
    cell->ohmic_resistance_ohm *= settings->resistance_factor;
    for (uint32_t i = 0u; i < CELL_MAX_TABLE; i++) {
        cell->resistance.ohm[i] *= settings->resistance_factor;
    }
}

void session_begin(session_t *session, const session_scenario_t *scenario,
                   const session_settings_t *settings)
{
    memset(session, 0, sizeof *session);
    session->scenario = scenario;
    session->settings = *settings;
    session->cell = scenario->charge.nominal;
    age(&session->cell, settings);
    session->memory.state = (cell_state_t){ settings->soc, settings->temperature_K,
                                            settings->temperature_K, settings->temperature_K };
    session->full_cooling_W = settings->cooling_power_W;
    session->published = scenario->published;
    normals_begin(&session->normals, &scenario->normals, settings->seed, SESSION_SENSOR_STREAM);
    session->peaks = (cell_peaks_t){
        .soc = settings->soc,
        .core_temperature_K = settings->temperature_K,
        .surface_temperature_K = settings->temperature_K,
        .voltage_V = session_voltage_V(session),
    };
    session_start_ecu(session);
}

double session_cooling_power_W(const session_t *session)
{
    const double share =
        within(session->memory.state.coolant / session->scenario->charge.cooling_band_K, 0.0, 1.0);
    return session->full_cooling_W * share;
}

double session_voltage_V(const session_t *session)
{
    return cell_terminal_voltage_V(&session->cell, &session->memory, session->current_A);
}

void session_measure(session_t *session, double readings[LINK_READINGS])
{
    const charge_scenario_t *scenario = &session->scenario->charge;
    const double truth[LINK_READINGS] = {
        session->current_A,
        session_voltage_V(session),
        session->memory.state.surface,
        session->memory.state.coolant,
        session_cooling_power_W(session),
    };
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        const charge_sensor_t *sensor = &scenario->sensors[i];
        const double normal = within(normals_next(&session->normals), -scenario->noise_cutoff,
                                     scenario->noise_cutoff);
        const double value = truth[i] + session->scenario->bias[i] + sensor->noise_std * normal;
        readings[i] = (sensor->resolution == 0.0)
                          ? value
                          : sensor->resolution * rint(value / sensor->resolution);
    }
}

uint32_t session_publish(session_t *session, const double *values, bool has_mode,
                         can_frame_t *frames)
{
    const uint32_t messages = has_mode ? SESSION_MESSAGES : SESSION_MESSAGES - 1u;
    wire_send(&session->published, messages, values, frames);
    return messages;
}

uint32_t session_exchange(session_t *session, const can_frame_t *frames, uint32_t count,
                          can_frame_t *answers)
{
    for (uint32_t i = 0u; i < count; i++) {
        bms_receive(&session->bms, &frames[i]);
    }
    bms_step(&session->bms);
    uint32_t answered = 0u;
    while ((answered < SESSION_MOST_FRAMES) && bms_transmit(&session->bms, &answers[answered])) {
        answered++;
    }
    return answered;
}

static const codec_message_t *command_of_ecu(const session_t *session)
{
    for (uint32_t i = 0u; i < CAN_TRANSMITTED_COUNT; i++) {
        if (CAN_TRANSMITTED[i].id == session->scenario->command.id) {
            return &CAN_TRANSMITTED[i];
        }
    }
    return NULL;
}

/* Two intact frames of one counter and different content contest the message for a window. */
static void note_intact(session_reception_t *reception, const codec_message_t *message,
                        const uint8_t *data)
{
    const uint32_t periods = 1u + message->policy.max_delta_counter;
    bool is_known = false;
    for (uint32_t period = 0u; period < periods; period++) {
        const session_intact_t *intact = &reception->intact[period];
        for (uint32_t i = 0u; i < intact->count; i++) {
            const uint8_t *other = intact->data[i];
            const bool is_same = memcmp(other, data, message->length) == 0;
            is_known = is_known || (is_same && (period == 0u));
            if (!is_same && ((other[1] & COUNTER_MASK) == (data[1] & COUNTER_MASK))) {
                reception->contested_periods = 1u + message->policy.window_periods;
            }
        }
    }
    session_intact_t *present = &reception->intact[0];
    if (!is_known && (present->count < SESSION_MOST_INTACT)) {
        memcpy(present->data[present->count++], data, message->length);
    }
}

static double told_A(const session_t *session, const uint8_t *data)
{
    double values[WIRE_MAX_SIGNALS];
    wire_decode(&session->scenario->command, data, values);
    return values[session->scenario->command_current];
}

/* The weakest of all intact commands of the period; one that says nothing counts as 0 A. */
static double weakest_A(const session_t *session, const session_intact_t *intact, double usable_A)
{
    for (uint32_t i = 0u; i < intact->count; i++) {
        const double other_A = told_A(session, intact->data[i]);
        usable_A = fmax(usable_A, isnan(other_A) ? 0.0 : other_A);
    }
    return usable_A;
}

double session_hear(session_t *session, const can_frame_t *frames, uint32_t count)
{
    session_reception_t *reception = &session->reception;
    const codec_message_t *message = command_of_ecu(session);
    double usable_A = (double)NAN;
    reception->has_told = false;
    for (uint32_t i = 0u; i < count; i++) {
        if (frames[i].id != message->id) {
            continue;
        }
        const e2e_status_t status =
            e2e_check(&reception->e2e, frames[i].data, frames[i].length, message->length,
                      message->data_ids, message->policy.max_delta_counter);
        if ((status != E2E_WRONG_LENGTH) && (status != E2E_WRONG_CRC)) {
            note_intact(reception, message, frames[i].data);
        }
        if (status == E2E_OK) {
            reception->has_told = true;
            memcpy(reception->told, frames[i].data, message->length);
            usable_A = told_A(session, frames[i].data);
        }
    }
    const session_intact_t ended = reception->intact[0];
    memmove(&reception->intact[1], &reception->intact[0],
            (SESSION_MOST_WINDOW - 1u) * sizeof reception->intact[0]);
    reception->intact[0].count = 0u;
    reception->contested_periods -= (reception->contested_periods > 0u) ? 1u : 0u;
    const bool is_usable = e2e_supervise(&reception->e2e, &message->policy).is_usable;
    if (reception->contested_periods > 0u) {
        return 0.0;
    }
    if (!is_usable || isnan(usable_A)) {
        return (double)NAN;
    }
    return (ended.count == 1u) ? usable_A : weakest_A(session, &ended, usable_A);
}

double session_obey(session_t *session, double usable_A)
{
    if (isnan(usable_A)) {
        session->silent_periods++;
    } else {
        session->silent_periods = 0u;
        session->held_A = within(usable_A, session->scenario->charge.reference_current_A, 0.0);
    }
    if (session->silent_periods >= session->scenario->silent_periods_to_stop) {
        session->held_A = 0.0;
    }
    return session->held_A;
}

void session_advance(session_t *session)
{
    static const double undisturbed[CHARGE_SUB_STEPS * CELL_KNOT_WIDTH] = { 0.0 };
    cell_hold(&session->cell, &session->memory, session->current_A,
              session_cooling_power_W(session), 1.0, &session->knot, undisturbed,
              CHARGE_SUB_STEPS, &session->peaks, NULL, NULL);
}
