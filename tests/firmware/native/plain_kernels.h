/* What the firmware's kernels compute, written without any of their shortcuts: every constraint
 * solved with its root, every edge clamped, every table searched from its beginning, the checksum
 * bit by bit. Operations on numbers are in the same order, so that results are the same bits. */
#ifndef PLAIN_KERNELS_H
#define PLAIN_KERNELS_H

#include "family.h"
#include "kan.h"
#include "rcbf.h"

kan_estimate_t plain_estimate(const kan_model_t *model, const float *inputs);

/* The steadied conditions are kept in `steadier`. */
rcbf_decision_t plain_decision(const rcbf_constants_t *constants, const rcbf_input_t *input,
                               float open_circuit_voltage_V, rcbf_steadier_t *steadier);

float plain_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc);

uint8_t plain_crc(const uint8_t *data, uint8_t length, uint8_t data_id);

/* Greatest value of a family's table where the state of charge may be, towards the next cell's. */
float plain_greatest(const float *cells, float soc_low, float soc_high);

/* Solves for the core whether or not it can decide. */
rcbf_decision_t plain_family_decision(const family_t *family, const family_constants_t *constants,
                                      const rcbf_constants_t *cell, const family_reading_t *in,
                                      float reference_A);

/* What the core's condition leaves at a current, in K/s. */
float plain_family_core_left(const family_t *family, const family_constants_t *constants,
                             const rcbf_constants_t *cell, const family_reading_t *in,
                             float reference_A, float current_A);

#endif
