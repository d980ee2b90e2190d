#include "session.h"

#include "can_db.h"

/* About the cell of the compiled-in preset; the ECU sees no model error to speak of. */
#define CAPACITY_AS 8280.0f
#define CORE_RESISTANCE_K_PER_W 1.7209f
#define CORE_CAPACITY_J_PER_K 23.6216f
#define SURFACE_RESISTANCE_K_PER_W 4.4868f
#define SURFACE_CAPACITY_J_PER_K 1.0f
#define COOLANT_CAPACITY_J_PER_K 20.248f
#define ENTROPY_V_PER_K 5.7962e-05f
#define PERIOD_S 0.1f

void session_begin(session_t *session, float soc, float temperature_K)
{
    *session = (session_t){
        .cell = { soc, temperature_K, temperature_K, temperature_K, 0.0f, 0.5f },
        .reference_A = BMS_DEFAULT_CALIBRATION.reference_current_A,
        .plug_in_soc = soc,
    };
}

void session_measure(const session_t *session, float values[VALUE_COUNT])
{
    const session_cell_t *cell = &session->cell;
    const rcbf_constants_t *constants = &BMS_DEFAULT_CALIBRATION.rcbf;
    values[VALUE_CURRENT] = cell->current_A;
    values[VALUE_VOLTAGE] = rcbf_open_circuit_voltage_V(constants, cell->soc) -
                            cell->current_A * constants->ohmic_resistance_ohm;
    values[VALUE_SURFACE] = cell->surface_K;
    values[VALUE_COOLANT] = cell->coolant_K;
    values[VALUE_COOLING] = cell->cooling_W;
    values[VALUE_REFERENCE] = session->reference_A;
    values[VALUE_PLUG_IN_SOC] = session->plug_in_soc;
    values[VALUE_REQUEST] = session->is_on ? (float)REQUEST_CHARGE : (float)REQUEST_OFF;
    values[VALUE_MODE] = (float)session->mode;
    values[VALUE_TIME_TO_FULL] = 3600.0f;
}

static uint32_t raw_wide(uint32_t signal, float value)
{
    return codec_encode(&CAN_SIGNALS[signal], value, CODEC_NEAREST);
}

static uint16_t raw(uint32_t signal, float value)
{
    return (uint16_t)raw_wide(signal, value);
}

/* A code of four bits; what it cannot hold is not available. */
static uint8_t code(float value)
{
    return ((value >= 0.0f) && (value < 15.0f)) ? (uint8_t)value : 15u;
}

static void pack(uint32_t message, const float values[VALUE_COUNT], uint8_t data[8])
{
    if (message == CAN_RECEIVED_CELL_ELECTRICAL) {
        const struct can_db_cell_electrical_t electrical = {
            .current = raw_wide(CAN_SIGNAL_CURRENT, values[VALUE_CURRENT]),
            .voltage = raw(CAN_SIGNAL_VOLTAGE, values[VALUE_VOLTAGE]),
        };
        (void)can_db_cell_electrical_pack(data, &electrical, 8u);
    } else if (message == CAN_RECEIVED_CELL_THERMAL) {
        const struct can_db_cell_thermal_t thermal = {
            .surface_temperature = raw(CAN_SIGNAL_SURFACE_TEMPERATURE, values[VALUE_SURFACE]),
            .coolant_temperature = raw(CAN_SIGNAL_COOLANT_TEMPERATURE, values[VALUE_COOLANT]),
        };
        (void)can_db_cell_thermal_pack(data, &thermal, 8u);
    } else if (message == CAN_RECEIVED_COOLANT) {
        const struct can_db_coolant_t coolant = {
            .cooling_power = raw(CAN_SIGNAL_COOLING_POWER, values[VALUE_COOLING]),
        };
        (void)can_db_coolant_pack(data, &coolant, 8u);
    } else if (message == CAN_RECEIVED_CHARGE_MODE) {
        const struct can_db_charge_mode_t mode = {
            .mode = code(values[VALUE_MODE]),
            .time_to_full = raw(CAN_SIGNAL_TIME_TO_FULL, values[VALUE_TIME_TO_FULL]),
        };
        (void)can_db_charge_mode_pack(data, &mode, 8u);
    } else {
        const struct can_db_charge_request_t asked = {
            .request = code(values[VALUE_REQUEST]),
            .reference_current = raw_wide(CAN_SIGNAL_REFERENCE_CURRENT, values[VALUE_REFERENCE]),
            .plug_in_state_of_charge =
                raw(CAN_SIGNAL_PLUG_IN_STATE_OF_CHARGE, values[VALUE_PLUG_IN_SOC]),
        };
        (void)can_db_charge_request_pack(data, &asked, 8u);
    }
}

bool session_sends(const session_t *session, uint32_t message)
{
    return session->sends_mode || !CAN_RECEIVED[message].is_optional;
}

void session_protect(can_frame_t *frame, uint32_t message, uint8_t counter)
{
    e2e_protect(frame->data, frame->length, CAN_RECEIVED[message].data_ids, counter);
}

can_frame_t session_frame(session_t *session, uint32_t message, const float values[VALUE_COUNT])
{
    can_frame_t frame = { .id = CAN_RECEIVED[message].id, .length = CAN_RECEIVED[message].length };
    pack(message, values, frame.data);
    session_protect(&frame, message, session->counters[message]);
    session->counters[message]++;
    return frame;
}

void session_advance(session_t *session, float command_A)
{
    session_cell_t *cell = &session->cell;
    const float resistance_ohm = BMS_DEFAULT_CALIBRATION.rcbf.ohmic_resistance_ohm;
    const float current_A = command_A;
    const float heat_W = resistance_ohm * current_A * current_A -
                         ENTROPY_V_PER_K * cell->core_K * current_A;
    const float core_to_surface_W = (cell->core_K - cell->surface_K) / CORE_RESISTANCE_K_PER_W;
    const float surface_to_coolant_W =
        (cell->surface_K - cell->coolant_K) / SURFACE_RESISTANCE_K_PER_W;
    cell->current_A = current_A;
    cell->soc -= PERIOD_S * current_A / CAPACITY_AS;
    cell->core_K += PERIOD_S * (heat_W - core_to_surface_W) / CORE_CAPACITY_J_PER_K;
    cell->surface_K +=
        PERIOD_S * (core_to_surface_W - surface_to_coolant_W) / SURFACE_CAPACITY_J_PER_K;
    cell->coolant_K +=
        PERIOD_S * (surface_to_coolant_W - cell->cooling_W) / COOLANT_CAPACITY_J_PER_K;
    /* The pump rests when the coolant is cold enough. */
    cell->cooling_W = (cell->coolant_K > 295.0f) ? 0.5f : 0.0f;
}
