#include "refusal.h"

#include "bms.h"
#include "can_catalog.h"
#include "can_db.h"

static void write_refusal(refusal_part_t part, image_status_t status, can_frame_t *frame)
{
    const struct can_db_boot_refusal_t message = {
        .refused_part = (uint8_t)part,
        .failed_check = (uint8_t)status,
    };
    frame->id = CAN_DB_BOOT_REFUSAL_FRAME_ID;
    frame->length = CAN_DB_BOOT_REFUSAL_LENGTH;
    (void)can_db_boot_refusal_pack(frame->data, &message, CAN_DB_BOOT_REFUSAL_LENGTH);
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
    const uint32_t faults = (uint32_t)1u << (uint32_t)FAULT_CALIBRATION;
    const codec_report_t report = {
        .command_A = 0.0f,
        .state = (uint8_t)BMS_FAULT,
        .first_fault = (uint8_t)FAULT_CALIBRATION,
        .active_faults = faults,
        .latched_faults = faults,
    };
    codec_write(CAN_TRANSMITTED_DIAGNOSTICS, &report, &frames[0]);
    codec_write(CAN_TRANSMITTED_IDENTITY, &report, &frames[1]);
    write_refusal(part, status, &frames[2]);
    codec_write(CAN_TRANSMITTED_CHARGE_COMMAND, &report, &frames[3]);
    for (uint32_t i = 0u; i < REFUSAL_FRAMES; i++) {
        if (MESSAGES[i]->is_protected) {
            e2e_protect(frames[i].data, frames[i].length, MESSAGES[i]->data_ids, (uint8_t)period);
        }
    }
}
