#include "codec.h"

#include <math.h>

#include "can_catalog.h"
#include "can_db.h"
#include "numeric.h"

/* The bound of the stack knows by the caller's name what it may call through a pointer. */
#if defined(__GNUC__)
#define CODEC_APART __attribute__((noinline))
#else
#define CODEC_APART
#endif

/* Share of a step by which float32 may miss a value that lies exactly on a step. */
#define STEP_TOLERANCE 0.02f
/* More than any signal has; float32 holds every whole number up to there. */
#define MOST_STEPS 16777216.0f
/* All ones of the fields that carry a code. */
#define TWO_BITS 3u
#define FOUR_BITS 15u
#define FIRST_FAULTS (((uint32_t)1u << CODEC_FIRST_FAULTS) - 1u)

uint32_t codec_encode(const codec_signal_t *signal, float value, codec_rounding_t rounding)
{
    if (!numeric_is_finite(value)) {
        return signal->raw_max + 2u;
    }
    const float up = (rounding == CODEC_TOWARDS_ZERO) ? STEP_TOLERANCE : 0.5f;
    /* Rounded before the offset comes on top, in which float32 would lose parts of a step. */
    const int32_t steps =
        (int32_t)numeric_smaller(fabsf(value) / signal->scale + up, MOST_STEPS);
    const int32_t raw = (numeric_is_negative(value) ? -steps : steps) - signal->offset_steps;
    if (raw < 0) {
        return 0u;
    }
    return ((uint32_t)raw < signal->raw_max) ? (uint32_t)raw : signal->raw_max;
}

float codec_decode(const codec_signal_t *signal, uint32_t raw)
{
    const float steps = (float)((int32_t)raw + signal->offset_steps);
    return (raw > signal->raw_max) ? NAN : (signal->scale * steps);
}

static float decode(uint32_t signal, uint32_t raw)
{
    return codec_decode(&CAN_SIGNALS[signal], raw);
}

static uint32_t encode_wide(uint32_t signal, float value)
{
    return codec_encode(&CAN_SIGNALS[signal], value, CODEC_NEAREST);
}

static uint16_t encode(uint32_t signal, float value)
{
    return (uint16_t)encode_wide(signal, value);
}

/* A code that its field cannot hold becomes all ones, which says "not available". */
static uint8_t code(uint8_t value, uint8_t all_ones)
{
    return (value < all_ones) ? value : all_ones;
}

void codec_read(uint32_t index, const uint8_t *data, codec_measurement_t *measurement)
{
    switch (index) {
    case CAN_RECEIVED_CELL_ELECTRICAL: {
        struct can_db_cell_electrical_t message;
        (void)can_db_cell_electrical_unpack(&message, data, CAN_DB_CELL_ELECTRICAL_LENGTH);
        measurement->current_A = decode(CAN_SIGNAL_CURRENT, message.current);
        measurement->voltage_V = decode(CAN_SIGNAL_VOLTAGE, message.voltage);
        break;
    }
    case CAN_RECEIVED_CELL_THERMAL: {
        struct can_db_cell_thermal_t message;
        (void)can_db_cell_thermal_unpack(&message, data, CAN_DB_CELL_THERMAL_LENGTH);
        measurement->surface_temperature_K =
            decode(CAN_SIGNAL_SURFACE_TEMPERATURE, message.surface_temperature);
        measurement->coolant_temperature_K =
            decode(CAN_SIGNAL_COOLANT_TEMPERATURE, message.coolant_temperature);
        break;
    }
    case CAN_RECEIVED_COOLANT: {
        struct can_db_coolant_t message;
        (void)can_db_coolant_unpack(&message, data, CAN_DB_COOLANT_LENGTH);
        measurement->cooling_power_W = decode(CAN_SIGNAL_COOLING_POWER, message.cooling_power);
        break;
    }
    case CAN_RECEIVED_CHARGE_REQUEST: {
        struct can_db_charge_request_t message;
        (void)can_db_charge_request_unpack(&message, data, CAN_DB_CHARGE_REQUEST_LENGTH);
        measurement->request = message.request;
        measurement->reference_current_A =
            decode(CAN_SIGNAL_REFERENCE_CURRENT, message.reference_current);
        measurement->plug_in_soc =
            decode(CAN_SIGNAL_PLUG_IN_STATE_OF_CHARGE, message.plug_in_state_of_charge);
        break;
    }
    case CAN_RECEIVED_CHARGE_MODE: {
        struct can_db_charge_mode_t message;
        (void)can_db_charge_mode_unpack(&message, data, CAN_DB_CHARGE_MODE_LENGTH);
        measurement->mode = message.mode;
        measurement->time_to_full_s = decode(CAN_SIGNAL_TIME_TO_FULL, message.time_to_full);
        break;
    }
    default:
        break;
    }
}

static void write_estimate(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_estimate_t message = {
        .core_temperature = encode(CAN_SIGNAL_CORE_TEMPERATURE, report->core_temperature_K),
        .state_of_charge = encode(CAN_SIGNAL_STATE_OF_CHARGE, report->soc),
        .error_bound = encode(CAN_SIGNAL_ERROR_BOUND, report->error_bound_K),
        .in_domain = code(report->in_domain, TWO_BITS),
    };
    (void)can_db_estimate_pack(data, &message, CAN_DB_ESTIMATE_LENGTH);
}

static void write_decision(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_decision_t message = {
        .active_constraint = code(report->active_constraint, FOUR_BITS),
        .feasible = code(report->feasible, TWO_BITS),
        .lower_current = encode_wide(CAN_SIGNAL_LOWER_CURRENT, report->lower_A),
        .upper_current = encode_wide(CAN_SIGNAL_UPPER_CURRENT, report->upper_A),
    };
    (void)can_db_decision_pack(data, &message, CAN_DB_DECISION_LENGTH);
}

static void write_margins(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_decision_margins_t message = {
        .voltage_margin = encode(CAN_SIGNAL_VOLTAGE_MARGIN, report->margins[0]),
        .soc_margin = encode(CAN_SIGNAL_SOC_MARGIN, report->margins[1]),
        .core_margin = encode(CAN_SIGNAL_CORE_MARGIN, report->margins[2]),
        .surface_margin = encode(CAN_SIGNAL_SURFACE_MARGIN, report->margins[3]),
    };
    (void)can_db_decision_margins_pack(data, &message, CAN_DB_DECISION_MARGINS_LENGTH);
}

static void write_diagnostics(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_diagnostics_t message = {
        .diagnostic_state = code(report->state, FOUR_BITS),
        .first_fault = report->first_fault,
        .active_faults = report->active_faults & FIRST_FAULTS,
        .latched_faults = report->latched_faults & FIRST_FAULTS,
    };
    (void)can_db_diagnostics_pack(data, &message, CAN_DB_DIAGNOSTICS_LENGTH);
}

static void write_more_diagnostics(const codec_report_t *report, uint8_t *data)
{
    const uint32_t faults = (report->fault_page == FAULT_PAGE_ACTIVE) ? report->active_faults
                                                                     : report->latched_faults;
    const struct can_db_diagnostics2_t message = {
        .fault_page = code(report->fault_page, FOUR_BITS),
        .more_faults = faults >> CODEC_FIRST_FAULTS,
    };
    (void)can_db_diagnostics2_pack(data, &message, CAN_DB_DIAGNOSTICS2_LENGTH);
}

static void write_network_diagnostics(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_network_diagnostics_t message = {
        .reported_message = code(report->reported_message, FOUR_BITS),
        .reported_state = code(report->reported_state, FOUR_BITS),
        .wrong_crc_frames = report->reported_counts.wrong_crc,
        .wrong_length_frames = report->reported_counts.wrong_length,
        .repeated_frames = report->reported_counts.repeated,
        .lost_frames = report->reported_counts.lost,
        .reordered_frames = report->reported_counts.reordered,
    };
    (void)can_db_network_diagnostics_pack(data, &message, CAN_DB_NETWORK_DIAGNOSTICS_LENGTH);
}

static void write_identity(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_identity_t message = {
        .model_hash = report->model_hash,
        .preset_hash = report->preset_hash,
        .firmware_version = report->firmware_version,
        .network_version = CAN_NETWORK_VERSION,
    };
    (void)can_db_identity_pack(data, &message, CAN_DB_IDENTITY_LENGTH);
}

static void write_start(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_start_t message = {
        .reset_cause = code(report->reset_cause, FOUR_BITS),
        .reset_count = report->reset_count,
        .calibration_content = report->calibration_content,
    };
    (void)can_db_start_pack(data, &message, CAN_DB_START_LENGTH);
}

static void write_plan(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_plan_t message = {
        .planned_current = encode_wide(CAN_SIGNAL_PLANNED_CURRENT, report->planned_A),
        .predicted_time_to_full =
            encode(CAN_SIGNAL_PREDICTED_TIME_TO_FULL, report->predicted_time_to_full_s),
    };
    (void)can_db_plan_pack(data, &message, CAN_DB_PLAN_LENGTH);
}

static void write_command(const codec_report_t *report, uint8_t *data)
{
    const struct can_db_charge_command_t message = {
        .command_current = codec_encode(&CAN_SIGNALS[CAN_SIGNAL_COMMAND_CURRENT],
                                        report->command_A, CODEC_TOWARDS_ZERO),
        .command_state = code(report->state, FOUR_BITS),
    };
    (void)can_db_charge_command_pack(data, &message, CAN_DB_CHARGE_COMMAND_LENGTH);
}

CODEC_APART void codec_write(uint32_t index, const codec_report_t *report, can_frame_t *frame)
{
    static void (*const WRITE[CAN_TRANSMITTED_COUNT])(const codec_report_t *, uint8_t *) = {
        [CAN_TRANSMITTED_ESTIMATE] = write_estimate,
        [CAN_TRANSMITTED_DECISION] = write_decision,
        [CAN_TRANSMITTED_DECISION_MARGINS] = write_margins,
        [CAN_TRANSMITTED_DIAGNOSTICS] = write_diagnostics,
        [CAN_TRANSMITTED_NETWORK_DIAGNOSTICS] = write_network_diagnostics,
        [CAN_TRANSMITTED_DIAGNOSTICS2] = write_more_diagnostics,
        [CAN_TRANSMITTED_IDENTITY] = write_identity,
        [CAN_TRANSMITTED_START] = write_start,
        [CAN_TRANSMITTED_PLAN] = write_plan,
        [CAN_TRANSMITTED_CHARGE_COMMAND] = write_command,
    };
    frame->id = CAN_TRANSMITTED[index].id;
    frame->length = CAN_TRANSMITTED[index].length;
    WRITE[index](report, frame->data);
}
