#include "refusal.h"

#include "bms.h"
#include "can_catalog.h"

void refusal_frames(refusal_part_t part, image_status_t status, uint32_t period,
                    can_frame_t frames[REFUSAL_FRAMES])
{
    static const uint8_t MESSAGES[REFUSAL_FRAMES] = {
        CAN_TRANSMITTED_DIAGNOSTICS,
        CAN_TRANSMITTED_IDENTITY,
        CAN_TRANSMITTED_BOOT_REFUSAL,
        CAN_TRANSMITTED_CHARGE_COMMAND,
    };
    const uint32_t faults = (uint32_t)1u << (uint32_t)FAULT_CALIBRATION;
    const codec_report_t report = {
        .command_A = 0.0f,
        .state = (uint8_t)BMS_FAULT,
        .first_fault = (uint8_t)FAULT_CALIBRATION,
        .active_faults = faults,
        .latched_faults = faults,
        .refused_part = (uint8_t)part,
        .failed_check = (uint8_t)status,
    };
    for (uint32_t i = 0u; i < REFUSAL_FRAMES; i++) {
        const codec_message_t *message = &CAN_TRANSMITTED[MESSAGES[i]];
        codec_write(MESSAGES[i], &report, &frames[i]);
        if (message->is_protected) {
            e2e_protect(frames[i].data, frames[i].length, message->data_ids, (uint8_t)period);
        }
    }
}
