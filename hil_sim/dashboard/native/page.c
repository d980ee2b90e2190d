#include "page.h"

#include <stddef.h>
#include <string.h>

#include "charge.h"
#include "session.h"

static session_scenario_t scenario;
static session_settings_t settings;
static session_t session;
static page_truth_t truth;
static charge_t beside;
static normals_t beside_normals;
static double readings[LINK_READINGS];
static double values[SESSION_MESSAGES * WIRE_MAX_SIGNALS];
static can_frame_t frames[SESSION_MOST_FRAMES];

void *scenario_address(void)
{
    return &scenario;
}

uint32_t scenario_size(void)
{
    return (uint32_t)sizeof scenario;
}

void *settings_address(void)
{
    return &settings;
}

uint32_t settings_size(void)
{
    return (uint32_t)sizeof settings;
}

void *readings_address(void)
{
    return readings;
}

void *values_address(void)
{
    return values;
}

void *frames_address(void)
{
    return frames;
}

uint32_t frame_size(void)
{
    return (uint32_t)sizeof frames[0];
}

uint32_t is_accepted(void)
{
    return calibration_is_valid(&scenario.calibration) ? 1u : 0u;
}

void begin(void)
{
    session_begin(&session, &scenario, &settings);
}

void start_ecu(void)
{
    session_start_ecu(&session);
}

void measure(void)
{
    session_measure(&session, readings);
}

uint32_t publish(uint32_t has_mode)
{
    return session_publish(&session, values, has_mode != 0u, frames);
}

uint32_t exchange(uint32_t count)
{
    return session_exchange(&session, frames, count, frames);
}

double hear(uint32_t count)
{
    return session_hear(&session, frames, count);
}

double obey(double usable_A)
{
    return session_obey(&session, usable_A);
}

void supply(double current_A)
{
    session.current_A = current_A;
}

void cool(double full_power_W)
{
    session.full_cooling_W = full_power_W;
}

void advance(void)
{
    session_advance(&session);
}

const void *told(void)
{
    return session.reception.has_told ? session.reception.told : NULL;
}

static const void *told_of(const cell_state_t *state, const cell_peaks_t *peaks, double voltage_V,
                           double current_A, double cooling_power_W)
{
    truth = (page_truth_t){
        .soc = state->soc,
        .core_temperature_K = state->core,
        .surface_temperature_K = state->surface,
        .coolant_temperature_K = state->coolant,
        .voltage_V = voltage_V,
        .current_A = current_A,
        .cooling_power_W = cooling_power_W,
        .peaks = *peaks,
    };
    return &truth;
}

const void *look(void)
{
    return told_of(&session.memory.state, &session.peaks, session_voltage_V(&session),
                   session.current_A, session_cooling_power_W(&session));
}

void begin_beside(void)
{
    memset(&beside, 0, sizeof beside);
    beside.scenario = &scenario.charge;
    beside.controller = CHARGE_S_CBF;
    beside.cell = session.cell;
    beside.full_cooling_W = settings.cooling_power_W;
    beside.plug_in_soc = settings.soc;
    beside.supply_gain = 1.0;
    beside.supply_share = 1.0;
    beside.memory.state = (cell_state_t){ settings.soc, settings.temperature_K,
                                          settings.temperature_K, settings.temperature_K };
    normals_begin(&beside_normals, &scenario.normals, settings.seed, SESSION_SENSOR_STREAM);
    charge_begin(&beside, &scenario.calibration);
}

uint32_t advance_beside(void)
{
    static const double undisturbed[CHARGE_SUB_STEPS * CELL_KNOT_WIDTH] = { 0.0 };
    double normals[LINK_READINGS];
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        normals[i] = normals_next(&beside_normals);
    }
    charge_advance(&beside, normals, undisturbed, 1u);
    return (uint32_t)beside.outcome;
}

const void *look_beside(void)
{
    return told_of(&beside.memory.state, &beside.peaks.cell,
                   cell_terminal_voltage_V(&beside.cell, &beside.memory, beside.current_A),
                   beside.current_A, beside.cooling_power_W);
}
