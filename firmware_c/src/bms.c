#include "bms.h"

#include <math.h>
#include <stddef.h>

#include "bms_growth.h"
#include "bms_plan.h"
#include "bms_symptoms.h"
#include "can_catalog.h"
#include "numeric.h"
#include "request.h"

/* Periods that the other nodes have to come up before their silence is a fault. */
#define START_UP_PERIODS 50u

typedef char transmitted_messages_agree[(BMS_TRANSMITTED_MESSAGES == CAN_TRANSMITTED_COUNT) ? 1
                                                                                           : -1];
typedef char faults_fit_into_their_mask[(FAULT_COUNT <= 32) ? 1 : -1];

static const rcbf_decision_t NO_DECISION = {
    0.0f, false, RCBF_INVALID, NAN, NAN, { NAN, NAN, NAN, NAN }
};

static const bms_start_t UNKNOWN_START = { UINT32_MAX, UINT8_MAX, UINT8_MAX };

void bms_init(bms_t *bms, const bms_config_t *config)
{
    *bms = (bms_t){ .state = BMS_INIT, .estimate = { NAN, false }, .decision = NO_DECISION };
    bms->start = UNKNOWN_START;
    monitor_reset(&bms->monitor);
    history_reset(&bms->history);
    thermal_reset(&bms->thermal);
    planner_reset(&bms->planner);
    if ((config != NULL) && (config->calibration != NULL) &&
        calibration_is_valid(config->calibration)) {
        bms->calibration = config->calibration;
        if (has_family(bms)) {
            family_reset(&bms->family, &bms->calibration->family);
        }
    }
}

void bms_tell_start(bms_t *bms, const bms_start_t *start)
{
    bms->start = *start;
}

void bms_receive(bms_t *bms, const can_frame_t *frame)
{
    network_receive(&bms->network, frame, &bms->measurement);
}

/* A sensor that is stuck, drifts or has come off reads colder than the heat allows, and so low a
 * reading is not believed, until the monitor sees the deficit. Of one cell it is not believed below
 * what the heat makes of that cell, so that the lie is no more than the prediction's error; of a
 * family not below its coldest cell. */
static void update_surface_temperature(bms_t *bms, float current_A, bool is_surface_usable)
{
    const codec_measurement_t *m = &bms->measurement;
    const bms_calibration_t *calibration = bms->calibration;
    bms->surface_temperature_K = m->surface_temperature_K;
    if (bms->thermal.is_known || is_surface_usable) {
        thermal_step(&bms->thermal, &calibration->thermal, current_A, m->surface_temperature_K,
                     bms->coolant_temperature_K);
        const float least_K =
            has_family(bms) ? thermal_coldest_surface_K(&bms->thermal, &calibration->thermal)
                            : thermal_predicted_surface_K(&bms->thermal);
        if (bms->surface_temperature_K < least_K) {
            bms->surface_temperature_K = least_K;
        }
    }
}

/* A reading just outside of the box, by no more than its error, is taken for one on its face. */
static float within_box(const kan_model_t *model, uint32_t input, float value, float error)
{
    const float reach = 1.0f / model->input_scale[input];
    const float low = model->input_center[input] - reach;
    const float high = model->input_center[input] + reach;
    if ((value < low) && (value >= low - error)) {
        return low;
    }
    return ((value > high) && (value <= high + error)) ? high : value;
}

static void look_up_voltage(bms_t *bms)
{
    if (!has_family(bms)) {
        bms->open_circuit_voltage_V = rcbf_open_circuit_voltage_near_V(
            &bms->calibration->rcbf, bms->soc.soc, &bms->ocv_segment);
    }
}

static void update_estimates(bms_t *bms)
{
    const codec_measurement_t *m = &bms->measurement;
    const bms_calibration_t *calibration = bms->calibration;
    const plausibility_t *limits = &calibration->plausibility;
    const bool is_current_usable = is_usable(bms, CAN_RECEIVED_CELL_ELECTRICAL) &&
                                   !is_outside(bms, OUTSIDE_CURRENT);
    const bool is_thermal_fresh = is_usable(bms, CAN_RECEIVED_CELL_THERMAL);
    const bool is_surface_usable = is_thermal_fresh && !is_outside(bms, OUTSIDE_SURFACE);
    const bool is_coolant_usable = is_thermal_fresh && !is_outside(bms, OUTSIDE_COOLANT);
    /* Without a usable reading the command is what has most likely flowed. */
    const float current_A = is_current_usable ? m->current_A : bms->command_A;
    if (is_coolant_usable) {
        bms->coolant_temperature_K = m->coolant_temperature_K;
    }
    update_surface_temperature(bms, current_A, is_surface_usable && is_coolant_usable);
    history_step(&bms->history, &calibration->kan, current_A, bms->surface_temperature_K,
                 is_surface_usable);
    float measured[KAN_MEASURED_INPUTS] = { m->current_A, m->cooling_power_W,
                                            bms->surface_temperature_K,
                                            m->coolant_temperature_K };
    for (uint32_t i = 0u; i < KAN_MEASURED_INPUTS; i++) {
        measured[i] =
            within_box(&calibration->kan, i, measured[i], limits->reading_error[i]);
    }
    bms->estimate = history_estimate(&bms->history, &calibration->kan, measured);
    if (has_family(bms)) {
        const family_reading_t reading = reading_of(bms);
        family_observe(&bms->family, &calibration->family, &calibration->rcbf, &reading);
    }
    if (bms->soc_known) {
        /* Out of a charge there is no command to count, but perhaps a load. */
        const float commanded_A = is_charging(bms) ? bms->command_A : current_A;
        soc_count(&bms->soc, current_A, commanded_A, calibration->sampling_period_s,
                  calibration->rcbf.capacity_As);
        look_up_voltage(bms);
    }
}

/* Follows the charge request; a charge begins only at an edge from off to charge, so that an ECU
 * that restarts in mid-charge stays off until somebody tells it the state of charge. */
static void follow_request(bms_t *bms, uint32_t symptoms)
{
    if (!is_usable(bms, CAN_RECEIVED_CHARGE_REQUEST)) {
        return;
    }
    if (bms->measurement.request == REQUEST_OFF) {
        bms->may_start = true;
        if ((bms->state == BMS_FAULT) && (symptoms == 0u)) {
            monitor_reset(&bms->monitor);
            bms->state = BMS_STANDBY;
        } else if (bms->state != BMS_FAULT) {
            bms->state = BMS_STANDBY;
        }
    } else if ((bms->state == BMS_STANDBY) && bms->may_start && (symptoms == 0u)) {
        soc_set(&bms->soc, bms->measurement.plug_in_soc);
        look_up_voltage(bms);
        bms->decision_segment = bms->ocv_segment;
        if (has_family(bms)) {
            const family_reading_t reading = reading_of(bms);
            family_begin(&bms->family, &bms->calibration->family, &bms->calibration->rcbf,
                         bms->measurement.plug_in_soc, &reading);
        }
        bms->soc_known = true;
        bms->may_start = false;
        bms->state = BMS_CHARGING;
    }
}

static bool is_full(const bms_t *bms)
{
    const bms_calibration_t *calibration = bms->calibration;
    return has_family(bms) ? family_is_full(&bms->family, &calibration->family,
                                            calibration->completion_soc)
                           : (bms->soc.soc >= calibration->completion_soc);
}

static void decide(bms_t *bms)
{
    const codec_measurement_t *m = &bms->measurement;
    const bms_calibration_t *calibration = bms->calibration;
    bms->decision = NO_DECISION;
    if (is_charging(bms) && is_full(bms)) {
        bms->state = BMS_COMPLETE;
        if (has_family(bms)) {
            /* Voltage and tail current know better than the count. */
            soc_set(&bms->soc, calibration->rcbf.max_soc);
        }
    }
    if (is_charging(bms) && has_family(bms)) {
        const family_reading_t reading = reading_of(bms);
        bms->decision = family_decide(&bms->family, &calibration->family, &calibration->rcbf,
                                      &reading, bms_wanted_current_A(bms));
        bms->state = (bms->decision.active == RCBF_NONE) ? BMS_CHARGING : BMS_DERATED;
    } else if (is_charging(bms)) {
        const rcbf_input_t input = {
            .soc = bms->soc.soc + calibration->soc_error,
            .core_temperature_K = { bms->estimate.core_temperature_K, 0.0f },
            .surface_temperature_K = { bms->surface_temperature_K, 0.0f },
            .coolant_temperature_K = { m->coolant_temperature_K, 0.0f },
            .cooling_power_W = m->cooling_power_W,
            .reference_current_A = bms_wanted_current_A(bms),
        };
        bms->decision = rcbf_solve_steadily(&calibration->rcbf, &input,
                                            rcbf_open_circuit_voltage_near_V(
                                                &calibration->rcbf, input.soc,
                                                &bms->decision_segment),
                                            &bms->steadier);
        bms->state = (bms->decision.active == RCBF_NONE) ? BMS_CHARGING : BMS_DERATED;
    }
}

static void run_period(bms_t *bms)
{
    bms->has_started = bms->has_started || network_is_valid(&bms->network) ||
                       (bms->periods >= START_UP_PERIODS);
    if (!bms->has_started) {
        return;
    }
    bms->outside = bms_readings_outside(bms);
    update_estimates(bms);
    uint32_t symptoms = bms_symptoms(bms);
    if (bms->state == BMS_INIT) {
        if (history_is_settling(&bms->history, &bms->calibration->kan)) {
            /* Filters that have not settled are no fault while nobody relies on them. */
            monitor_step(&bms->monitor, symptoms & ~bit_if(true, FAULT_OUT_OF_DOMAIN));
            bms->state = (bms->monitor.latched != 0u) ? BMS_FAULT : BMS_INIT;
            return;
        }
        bms->state = BMS_STANDBY;
    }
    follow_request(bms, symptoms);
    bms_plan(bms);
    decide(bms);
    /* A reading that is no number spoils the decision too, but has a name of its own. */
    symptoms |= bit_if(!monitor_stops(symptoms) && is_charging(bms) &&
                           (bms->decision.active == RCBF_INVALID),
                       FAULT_DECISION_INVALID);
    monitor_step(&bms->monitor, symptoms);
    if (bms->monitor.latched != 0u) {
        bms->state = BMS_FAULT;
    }
    const bool may_charge = is_charging(bms) && !bms->monitor.stop && bms->decision.feasible;
    bms_follow_growth(bms);
    bms->command_A = may_charge ? bms->decision.current_A : 0.0f;
}

static void queue_frames(bms_t *bms)
{
    /* The received messages take turns in being reported. */
    const uint32_t turn =
        bms->periods / CAN_TRANSMITTED[CAN_TRANSMITTED_NETWORK_DIAGNOSTICS].every_periods;
    const uint8_t reported = (uint8_t)(turn % CAN_RECEIVED_COUNT);
    const uint32_t page_turn =
        bms->periods / CAN_TRANSMITTED[CAN_TRANSMITTED_DIAGNOSTICS2].every_periods;
    const codec_report_t report = {
        .command_A = bms->command_A,
        .state = (uint8_t)bms->state,
        .core_temperature_K = bms->estimate.core_temperature_K,
        .soc = bms->soc_known ? bms->soc.soc : NAN,
        .error_bound_K = (bms->calibration != NULL)
                             ? bms->calibration->rcbf.estimation_error_bound_K
                             : NAN,
        .in_domain = bms->estimate.in_domain ? 1u : 0u,
        .active_constraint = (uint8_t)bms->decision.active,
        .feasible = bms->decision.feasible ? 1u : 0u,
        .lower_A = bms->decision.lower_A,
        .upper_A = bms->decision.upper_A,
        .margins = { bms->decision.margins[0], bms->decision.margins[1], bms->decision.margins[2],
                     bms->decision.margins[3] },
        .first_fault = bms->monitor.first,
        .active_faults = bms->monitor.active,
        .latched_faults = bms->monitor.latched,
        .fault_page = (uint8_t)(page_turn % 2u),
        .reported_message = reported,
        .reported_state = (uint8_t)bms->network.receivers[reported].state,
        .reported_counts = bms->network.receivers[reported].counts,
        .model_hash = (bms->calibration != NULL) ? bms->calibration->model_hash : 0u,
        .preset_hash = (uint16_t)((bms->calibration != NULL)
                                      ? (bms->calibration->preset_hash >> 16u)
                                      : 0u),
        .firmware_version = BMS_FIRMWARE_VERSION,
        .calibration_content = bms->start.calibration_content,
        .reset_cause = bms->start.reset_cause,
        .reset_count = bms->start.reset_count,
        .planned_A = -bms->planner.planned_A,
        .predicted_time_to_full_s = bms->planner.time_to_full_s,
    };
    can_frame_t *frame = bms->outbox;
    for (uint32_t i = 0u; i < CAN_TRANSMITTED_COUNT; i++) {
        const bool is_due = (bms->periods % CAN_TRANSMITTED[i].every_periods) == 0u;
        if (!is_due || (CAN_TRANSMITTED[i].is_optional && !bms_has_planned_mode(bms))) {
            continue;
        }
        codec_write(i, &report, frame);
        if (CAN_TRANSMITTED[i].is_protected) {
            e2e_protect(frame->data, frame->length, CAN_TRANSMITTED[i].data_ids,
                        bms->counters[i]);
            bms->counters[i]++;
        }
        frame++;
    }
    bms->outbox_length = (uint32_t)(frame - bms->outbox);
    bms->outbox_next = 0u;
}

/* Only a charge counts on its periods, and only what has passed since it began. */
static void follow_pace(bms_t *bms)
{
    if (is_charging(bms)) {
        pace_step(&bms->pace, bms->network.measured_periods);
    } else {
        bms->pace = (pace_t){ 0 };
    }
    bms->network.measured_periods = 0u;
}

void bms_step(bms_t *bms)
{
    network_step(&bms->network);
    follow_pace(bms);
    if (bms->calibration != NULL) {
        run_period(bms);
    } else {
        monitor_step(&bms->monitor, bit_if(true, FAULT_CALIBRATION));
        bms->state = BMS_FAULT;
    }
    queue_frames(bms);
    bms->periods++;
}

bool bms_transmit(bms_t *bms, can_frame_t *frame)
{
    if (bms->outbox_next >= bms->outbox_length) {
        return false;
    }
    *frame = bms->outbox[bms->outbox_next];
    bms->outbox_next++;
    return true;
}
