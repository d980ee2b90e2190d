#include "host.h"

#include "can_catalog.h"

const bms_calibration_t *host_default_calibration(void)
{
    return &BMS_DEFAULT_CALIBRATION;
}

const fault_policy_t *host_fault_policies(void)
{
    return MONITOR_POLICY;
}

const codec_message_t *host_transmitted_messages(void)
{
    return CAN_TRANSMITTED;
}

uint32_t host_transmitted_count(void)
{
    return CAN_TRANSMITTED_COUNT;
}

void host_estimate_rows(const kan_model_t *model, const float *inputs, uint32_t rows,
                        float *core_temperature_K, uint8_t *in_domain)
{
    for (uint32_t i = 0u; i < rows; i++) {
        const kan_estimate_t estimate = kan_evaluate(model, &inputs[i * model->width[0]]);
        core_temperature_K[i] = estimate.core_temperature_K;
        in_domain[i] = estimate.in_domain ? 1u : 0u;
    }
}

void host_edge_values(const kan_model_t *model, uint32_t edge, const float *arguments,
                      uint32_t count, float *values, uint8_t *in_domain)
{
    for (uint32_t i = 0u; i < count; i++) {
        bool inside = true;
        values[i] = kan_edge_value(model, edge, arguments[i], &inside);
        in_domain[i] = inside ? 1u : 0u;
    }
}

void host_decide_rows(const rcbf_constants_t *constants, const rcbf_input_t *inputs, uint32_t rows,
                      float *current_A)
{
    for (uint32_t i = 0u; i < rows; i++) {
        current_A[i] = rcbf_solve(constants, &inputs[i]).current_A;
    }
}

uint32_t host_run_periods(bms_t *bms, const can_frame_t *received, uint32_t frames_a_period,
                          uint32_t periods, float *command_A)
{
    can_frame_t sent;
    uint32_t frames_sent = 0u;
    for (uint32_t period = 0u; period < periods; period++) {
        for (uint32_t i = 0u; i < frames_a_period; i++) {
            bms_receive(bms, received++);
        }
        bms_step(bms);
        while (bms_transmit(bms, &sent)) {
            frames_sent++;
        }
        command_A[period] = bms->command_A;
    }
    return frames_sent;
}

uint32_t host_exchange(bms_t *bms, const can_frame_t *received, uint32_t count, can_frame_t *sent,
                       uint32_t room)
{
    for (uint32_t i = 0u; i < count; i++) {
        bms_receive(bms, &received[i]);
    }
    bms_step(bms);
    uint32_t answers = 0u;
    while ((answers < room) && bms_transmit(bms, &sent[answers])) {
        answers++;
    }
    return answers;
}
