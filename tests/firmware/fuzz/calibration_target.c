/* A calibration with numbers of an input in it, of one cell or of a family, and a charge with what
 * the ECU takes. What it takes must lie within what no cell is charged at, and give numbers.
 */
#include <float.h>
#include <math.h>

#include "family_calibration.h"
#include "input.h"
#include "session.h"
#include "watch.h"

#define PERIODS 60u

static bool is_number(float value)
{
    return fabsf(value) <= FLT_MAX;
}

static bool is_within(float value, float low, float high)
{
    return (value >= low) && (value <= high);
}

/* Hard limits of docs/safety: those that any integrator may rely on, whatever the calibration. */
static void hold_envelope(const bms_calibration_t *c)
{
    MUST(c->layout == 5u, "a calibration of another layout is taken");
    MUST(is_within(c->reference_current_A, -3000.0f, 0.0f) && (c->reference_current_A < 0.0f),
         "a current beyond the envelope is taken");
    MUST(is_within(c->rcbf.max_voltage_V, 1.5f, 4.5f), "a voltage beyond the envelope is taken");
    MUST(is_within(c->rcbf.max_core_temperature_K.high_K, 253.0f, 353.0f) &&
             is_within(c->rcbf.max_surface_temperature_K.high_K, 253.0f, 353.0f),
         "a temperature beyond the envelope is taken");
    MUST(is_within(c->rcbf.max_soc, 0.0f, 1.0f) && is_within(c->completion_soc, 0.0f, 1.0f),
         "a state of charge beyond the envelope is taken");
    MUST(is_within(c->rcbf.capacity_As, 1800.0f, 1.08e6f), "a capacity beyond the envelope is taken");
    MUST(is_within(c->plausibility.voltage_overshoot_V, 0.0f, 0.3f) &&
             is_within(c->plausibility.temperature_overshoot_K, 0.0f, 10.0f),
         "an overshoot beyond the envelope is taken");
    MUST(is_within(c->sampling_period_s, 0.001f, 10.0f), "a period beyond the envelope is taken");
}

static void hold_numbers(const bms_t *bms)
{
    MUST(is_number(bms->command_A), "the command is no number");
    MUST(bms->command_A >= -3000.0f, "current beyond the envelope");
    MUST(is_number(bms->growth_A) || (bms->state == BMS_INIT), "the growth is no number");
    MUST(!bms->soc_known || is_number(bms->soc.soc), "the state of charge is no number");
    MUST((bms->command_A == 0.0f) || !bms->estimate.in_domain ||
             is_number(bms->estimate.core_temperature_K),
         "current with an estimate that is no number");
    MUST((bms->command_A == 0.0f) || bms->decision.feasible, "current that no constraint admits");
    if ((bms->command_A != 0.0f) && (bms->calibration->family.is_stated == 0u)) {
        for (uint32_t i = 0u; i < RCBF_CONSTRAINTS; i++) {
            MUST(!isnan(bms->decision.margins[i]), "current with a margin that is no number");
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
    static bms_calibration_t calibration;
    static bms_t bms;
    static session_t session;
    static watch_t watch;
    input_t input = { bytes, length };
    const uint8_t choice = input_byte(&input);
    memcpy(&calibration, &BMS_DEFAULT_CALIBRATION, sizeof calibration);
    if ((choice & 3u) == 1u) {
        memcpy(&calibration, FAMILY_CALIBRATION, FAMILY_CALIBRATION_BYTES);
    } else if ((choice & 3u) == 2u) {
        memset(&calibration, 0, sizeof calibration);
    }
    input_patch(&input, (uint8_t *)&calibration, sizeof calibration);
    if ((choice & 3u) == 3u) { /* raw */
        const size_t share = (input.left < sizeof calibration) ? input.left : sizeof calibration;
        memcpy(&calibration, input.bytes, share);
        input.bytes += share;
        input.left -= share;
    }
    const bms_config_t config = { &calibration };
    bms_init(&bms, &config);
    if (bms.calibration == NULL) {
        bms_step(&bms);
        MUST((bms.state == BMS_FAULT) && (bms.command_A == 0.0f), "current without a calibration");
        return 0;
    }
    hold_envelope(&calibration);
    const float soc = (float)input_byte(&input) / 255.0f;
    session_begin(&session, soc, 273.0f + 0.25f * (float)input_byte(&input));
    session.reference_A = -0.25f * (float)input_byte(&input);
    session.sends_mode = (choice & 4u) != 0u;
    session.mode = MODE_FASTEST;
    watch_begin(&watch, &calibration);
    for (uint32_t period = 0u; period < PERIODS; period++) {
        float values[VALUE_COUNT];
        const uint8_t disturbance = input_byte(&input);
        session.is_on = period > 10u;
        session_measure(&session, values);
        values[disturbance % 5u] += 0.01f * (float)(disturbance / 5u);
        for (uint32_t i = 0u; i < CAN_RECEIVED_COUNT; i++) {
            if (session_sends(&session, i)) {
                const can_frame_t frame = session_frame(&session, i, values);
                watch_frame(&watch, &frame);
                bms_receive(&bms, &frame);
            }
        }
        const float command_A = watch_step(&watch, &bms);
        hold_numbers(&bms);
        session_advance(&session, command_A);
    }
    return 0;
}
