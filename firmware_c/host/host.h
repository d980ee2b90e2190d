/* What a host needs beyond the firmware: constants by address, and its functions by the thousand.
 *
 * For the extension behind Python alone; no port contains it.
 */
#ifndef HOST_H
#define HOST_H

#include <stdint.h>

#include "bms.h"
#include "codec.h"
#include "image.h"
#include "monitor.h"

#ifdef __cplusplus
extern "C" {
#endif

const bms_calibration_t *host_default_calibration(void);
const fault_policy_t *host_fault_policies(void);
const codec_message_t *host_transmitted_messages(void);
uint32_t host_transmitted_count(void);

/* Estimates of `rows` rows of inputs, as many in each as the network has. */
void host_estimate_rows(const kan_model_t *model, const float *inputs, uint32_t rows,
                        float *core_temperature_K, uint8_t *in_domain);

/* Values of one edge of the network at `count` arguments. */
void host_edge_values(const kan_model_t *model, uint32_t edge, const float *arguments,
                      uint32_t count, float *values, uint8_t *in_domain);

/* Decisions on `rows` inputs. */
void host_decide_rows(const rcbf_constants_t *constants, const rcbf_input_t *inputs, uint32_t rows,
                      float *current_A);

/* Feeds `frames_a_period` frames before each step; returns how many frames the ECU sent. */
uint32_t host_run_periods(bms_t *bms, const can_frame_t *received, uint32_t frames_a_period,
                          uint32_t periods, float *command_A);

/* One control period: takes `count` frames, steps, and fills `sent` with up to `room` frames of the
 * answer; returns how many there are. */
uint32_t host_exchange(bms_t *bms, const can_frame_t *received, uint32_t count, can_frame_t *sent,
                       uint32_t room);

#ifdef __cplusplus
}
#endif

#endif
