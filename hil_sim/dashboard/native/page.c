/* What the page calls: one charge, and S-CBF's beside it, in the memory of a module. The page writes
 * scenario and settings to the places that are given here, after it has compared the sizes. */
#include <stddef.h>
#include <string.h>

#include "charge.h"
#include "session.h"

#define PAGE(name) __attribute__((export_name(#name), used))

/* What the page shows of the truth. */
typedef struct {
    double soc;
    double core_temperature_K;
    double surface_temperature_K;
    double coolant_temperature_K;
    double voltage_V;
    double current_A;
    double cooling_power_W;
    cell_peaks_t peaks;
} page_truth_t;

static session_scenario_t scenario;
static session_settings_t settings;
static session_t session;
static page_truth_t truth;
static charge_t beside;
static normals_t beside_normals;
static double readings[LINK_READINGS];
static double values[SESSION_MESSAGES * WIRE_MAX_SIGNALS];
static can_frame_t frames[SESSION_MOST_FRAMES];

PAGE(scenario_address) void *scenario_address(void)
{
    return &scenario;
}

PAGE(scenario_size) uint32_t scenario_size(void)
{
    return (uint32_t)sizeof scenario;
}

PAGE(settings_address) void *settings_address(void)
{
    return &settings;
}

PAGE(settings_size) uint32_t settings_size(void)
{
    return (uint32_t)sizeof settings;
}

PAGE(readings_address) void *readings_address(void)
{
    return readings;
}

PAGE(values_address) void *values_address(void)
{
    return values;
}

PAGE(frames_address) void *frames_address(void)
{
    return frames;
}

PAGE(frame_size) uint32_t frame_size(void)
{
    return (uint32_t)sizeof frames[0];
}

PAGE(begin) void begin(void)
{
    session_begin(&session, &scenario, &settings);
}

PAGE(start_ecu) void start_ecu(void)
{
    session_start_ecu(&session);
}

PAGE(measure) void measure(void)
{
    session_measure(&session, readings);
}

PAGE(publish) uint32_t publish(uint32_t has_mode)
{
    return session_publish(&session, values, has_mode != 0u, frames);
}

PAGE(exchange) uint32_t exchange(uint32_t count)
{
    return session_exchange(&session, frames, count, frames);
}

PAGE(hear) double hear(uint32_t count)
{
    return session_hear(&session, frames, count);
}

PAGE(obey) double obey(double usable_A)
{
    return session_obey(&session, usable_A);
}

PAGE(supply) void supply(double current_A)
{
    session.current_A = current_A;
}

PAGE(cool) void cool(double full_power_W)
{
    session.full_cooling_W = full_power_W;
}

PAGE(advance) void advance(void)
{
    session_advance(&session);
}

/* The command in sequence that the last frames brought; NULL for none. */
PAGE(told) const void *told(void)
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

PAGE(look) const void *look(void)
{
    return told_of(&session.memory.state, &session.peaks, session_voltage_V(&session),
                   session.current_A, session_cooling_power_W(&session));
}

PAGE(begin_beside) void begin_beside(void)
{
    memset(&beside, 0, sizeof beside);
    beside.scenario = &scenario.charge;
    beside.controller = CHARGE_S_CBF;
    beside.cell = session.cell;
    beside.full_cooling_W = settings.cooling_power_W;
    beside.plug_in_soc = settings.soc;
    beside.supply_gain = 1.0;
    beside.supply_share = 1.0;
    beside.memory = session.memory;
    normals_begin(&beside_normals, &scenario.normals, settings.seed, SESSION_SENSOR_STREAM);
    charge_begin(&beside, &scenario.calibration);
}

/* One period of S-CBF; its charge_outcome_t. */
PAGE(advance_beside) uint32_t advance_beside(void)
{
    static const double undisturbed[CHARGE_SUB_STEPS * CELL_KNOT_WIDTH] = { 0.0 };
    double normals[LINK_READINGS];
    for (uint32_t i = 0u; i < LINK_READINGS; i++) {
        normals[i] = normals_next(&beside_normals);
    }
    charge_advance(&beside, normals, undisturbed, 1u);
    return (uint32_t)beside.outcome;
}

PAGE(look_beside) const void *look_beside(void)
{
    return told_of(&beside.memory.state, &beside.peaks.cell,
                   cell_terminal_voltage_V(&beside.cell, &beside.memory, beside.current_A),
                   beside.current_A, beside.cooling_power_W);
}
