#include "pack_ecu.h"

#include <math.h>
#include <stddef.h>

#include "numeric.h"
#include "pack_balance.h"
#include "pack_cell.h"
#include "pack_codec.h"
#include "pack_network.h"
#include "pack_report.h"

/* Periods that the other nodes have to come up before their silence is a fault; as in bms.c. */
#define START_UP_PERIODS 50u

typedef char messages_agree[(PACK_ECU_MESSAGES == PACK_RECEIVED_COUNT) ? 1 : -1];
typedef char cells_fit[(BMS_MAX_CELLS <= PACK_GROUP_CELLS) ? 1 : -1];

void pack_ecu_init(pack_ecu_t *ecu, const pack_ecu_config_t *config)
{
    /* Until a request says off, so that an ECU that restarts in mid-charge begins none. */
    *ecu = (pack_ecu_t){ .missing_cell = PACK_NO_CELL, .first_fault = FAULT_NONE,
                         .is_asked = true };
    pack_init(&ecu->pack, (config != NULL) ? &config->pack : NULL);
    monitor_reset(&ecu->monitor);
    ecu->pack_voltage_error_V = (config != NULL) ? config->pack_voltage_error_V : NAN;
    if (config != NULL) {
        ecu->now = config->now;
        ecu->soon = config->soon;
        ecu->balance = config->balance;
    }
    for (uint32_t page = 0u; page < pack_pages(BMS_MAX_CELLS); page++) {
        ecu->plug_in_age[page] = UINT8_MAX;
    }
}

void pack_ecu_receive(pack_ecu_t *ecu, const can_frame_t *frame)
{
    pack_network_receive(ecu, frame);
}

/* What came of a request holds as long as it is usable; a fault ends what was asked for, so that the
 * charger has to ask anew. The states of charge that were told until then are of the past. */
static void follow_request(pack_ecu_t *ecu, uint32_t symptoms)
{
    if (!ecu->is_usable[PACK_RECEIVED_REQUEST]) {
        return;
    }
    if (ecu->request == REQUEST_OFF) {
        if (ecu->is_asked) {
            pack_network_forget_plug_in(ecu);
        }
        ecu->is_asked = false;
        if (symptoms == 0u) {
            monitor_reset(&ecu->monitor);
            ecu->latched_faults = 0u;
            ecu->first_fault = FAULT_NONE;
        }
    } else if (ecu->request == REQUEST_CHARGE) {
        ecu->is_asked = true;
    }
}

/* Whether the network allows no current in this period, or none any more. */
static bool is_stopped(const pack_ecu_t *ecu)
{
    return ecu->monitor.stop || (ecu->monitor.latched != 0u);
}

static void step_core(pack_ecu_t *ecu)
{
    const pack_readings_t readings = {
        .current_A = ecu->is_usable[PACK_RECEIVED_ELECTRICAL] ? ecu->current_A
                                                              : ecu->pack.command_A,
        .voltage_V = ecu->voltage_V,
        .surface_temperature_K = ecu->surface_temperature_K,
        .coolant_in_K = ecu->coolant_in_K,
        .coolant_out_K = ecu->coolant_out_K,
        .cooling_power_W = ecu->cooling_power_W,
        .charge = ecu->is_asked && (ecu->monitor.latched == 0u),
        .reference_current_A = is_stopped(ecu) ? 0.0f : ecu->reference_current_A,
        .plug_in_soc = ecu->plug_in_soc,
        .bled_soc = ecu->bled_soc,
    };
    const bool could_start = ecu->pack.may_start;
    pack_step(&ecu->pack, &readings);
    if (could_start && !ecu->pack.may_start) {
        pack_balance_begin(ecu);
    }
}

static void note_faults(pack_ecu_t *ecu)
{
    if (ecu->first_fault == FAULT_NONE) {
        ecu->first_fault = (ecu->monitor.first != FAULT_NONE) ? ecu->monitor.first
                                                              : ecu->pack.monitor.first;
    }
    ecu->latched_faults |= ecu->monitor.latched | ecu->pack.monitor.latched;
}

static void run_period(pack_ecu_t *ecu)
{
    ecu->has_started = ecu->has_started || pack_network_is_valid(ecu) ||
                       (ecu->periods >= START_UP_PERIODS);
    if (!ecu->has_started) {
        return;
    }
    const uint32_t symptoms = pack_network_symptoms(ecu);
    follow_request(ecu, symptoms);
    monitor_step(&ecu->monitor, symptoms);
    step_core(ecu);
    note_faults(ecu);
}

/* What the core has decided, where the network allows it; anything else than a charging current
 * within the calibration's is none. */
static float command_of(const pack_ecu_t *ecu)
{
    if (!ecu->has_started || is_stopped(ecu) || (ecu->pack.calibration == NULL) ||
        !numeric_is_within(ecu->pack.command_A, ecu->pack.calibration->reference_current_A,
                           0.0f)) {
        return 0.0f;
    }
    return ecu->pack.command_A;
}

/* What a decision of this period leaves is not exceeded. */
static void follow_function(pack_ecu_t *ecu)
{
    const pack_t *pack = &ecu->pack;
    const rcbf_decision_t *decision = &pack->decision.decision;
    ecu->allowed_now_A = 0.0f;
    ecu->allowed_soon_A = 0.0f;
    if (!ecu->has_started || is_stopped(ecu)) {
        return;
    }
    const pack_worst_t worst = pack_worst(pack);
    ecu->allowed_now_A = pack_function_A(pack, &worst, &ecu->now);
    if (pack_is_charging(pack) && (decision->active != RCBF_NONE)) {
        ecu->allowed_now_A = decision->feasible
                                 ? numeric_larger(ecu->allowed_now_A, decision->lower_A)
                                 : 0.0f;
    }
    ecu->allowed_soon_A =
        numeric_larger(pack_function_A(pack, &worst, &ecu->soon), ecu->allowed_now_A);
}

static void follow_pace(pack_ecu_t *ecu)
{
    if (pack_is_charging(&ecu->pack)) {
        pace_step(&ecu->pace, ecu->measured_periods);
    } else {
        ecu->pace = (pace_t){ 0 };
    }
    ecu->measured_periods = 0u;
}

void pack_ecu_step(pack_ecu_t *ecu)
{
    pack_network_step(ecu);
    follow_pace(ecu);
    if (ecu->pack.calibration != NULL) {
        run_period(ecu);
    } else {
        ecu->has_started = true;
        step_core(ecu);
        note_faults(ecu);
    }
    ecu->command_A = command_of(ecu);
    follow_function(ecu);
    pack_balance_step(ecu);
    pack_report_queue(ecu);
    ecu->is_disturbed = false;
    ecu->periods++;
}

bool pack_ecu_transmit(pack_ecu_t *ecu, can_frame_t *frame)
{
    if (ecu->outbox_next >= ecu->outbox_length) {
        return false;
    }
    *frame = ecu->outbox[ecu->outbox_next];
    ecu->outbox_next++;
    return true;
}
