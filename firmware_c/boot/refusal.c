#include "refusal.h"

#include "bms.h"
#include "can_catalog.h"
#include "can_db.h"

/* The raw value of 0 A, without the floating point that encodes other currents. */
static uint32_t no_current(void)
{
    return (uint32_t)-CAN_SIGNALS[CAN_SIGNAL_COMMAND_CURRENT].offset_steps;
}

static void write_diagnostics(can_frame_t *frame)
{
    const uint32_t faults = (uint32_t)1u << (uint32_t)FAULT_CALIBRATION;
    const struct can_db_diagnostics_t message = {
        .diagnostic_state = (uint8_t)BMS_FAULT,
        .first_fault = (uint8_t)FAULT_CALIBRATION,
        .active_faults = faults,
        .latched_faults = faults,
    };
    (void)can_db_diagnostics_pack(frame->data, &message, CAN_DB_DIAGNOSTICS_LENGTH);
}

static void write_identity(can_frame_t *frame)
{
    const struct can_db_identity_t message = { .network_version = CAN_NETWORK_VERSION };
    (void)can_db_identity_pack(frame->data, &message, CAN_DB_IDENTITY_LENGTH);
}

static void write_refusal(refusal_part_t part, image_status_t status, can_frame_t *frame)
{
    const struct can_db_boot_refusal_t message = {
        .refused_part = (uint8_t)part,
        .failed_check = (uint8_t)status,
    };
    (void)can_db_boot_refusal_pack(frame->data, &message, CAN_DB_BOOT_REFUSAL_LENGTH);
}

static void write_command(can_frame_t *frame)
{
    const struct can_db_charge_command_t message = {
        .command_current = no_current(),
        .command_state = (uint8_t)BMS_FAULT,
    };
    (void)can_db_charge_command_pack(frame->data, &message, CAN_DB_CHARGE_COMMAND_LENGTH);
}

void refusal_frames(refusal_part_t part, image_status_t status, uint32_t period,
                    can_frame_t frames[REFUSAL_FRAMES])
{
    static const codec_message_t *const MESSAGES[REFUSAL_FRAMES] = {
        &CAN_TRANSMITTED[CAN_TRANSMITTED_DIAGNOSTICS],
        &CAN_TRANSMITTED[CAN_TRANSMITTED_IDENTITY],
        &CAN_BOOT_STAGE[CAN_BOOT_STAGE_BOOT_REFUSAL],
        &CAN_TRANSMITTED[CAN_TRANSMITTED_CHARGE_COMMAND],
    };
    write_diagnostics(&frames[0]);
    write_identity(&frames[1]);
    write_refusal(part, status, &frames[2]);
    write_command(&frames[3]);
    for (uint32_t i = 0u; i < REFUSAL_FRAMES; i++) {
        frames[i].id = MESSAGES[i]->id;
        frames[i].length = MESSAGES[i]->length;
        if (MESSAGES[i]->is_protected) {
            e2e_protect(frames[i].data, frames[i].length, MESSAGES[i]->data_ids, (uint8_t)period);
        }
    }
}
