/* Everything that depends on a cell or a model, as one relocatable block without pointers. */
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#include "family.h"
#include "kan.h"
#include "planner.h"
#include "rcbf.h"
#include "thermal.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Raised whenever the layout of bms_calibration_t or of one of its parts changes. */
#define BMS_CALIBRATION_LAYOUT 5

typedef struct {
    float low;
    float high;
} range_t;

/* Readings outside these ranges are taken for a broken sensor. */
typedef struct {
    range_t current_A;
    range_t voltage_V;
    range_t surface_temperature_K;
    range_t coolant_temperature_K;
    range_t cooling_power_W;
    float current_deviation_A;  /* measured against commanded */
    float voltage_deviation_V;  /* measured against open-circuit voltage and ohmic drop */
    float voltage_overshoot_V;  /* over the limit, before it is a fault */
    float temperature_overshoot_K;
    float surface_deficit_K; /* below the coldest that the heat allows, before it is a fault */
    float reading_error[4];  /* of the estimator's measured inputs, in their order */
} plausibility_t;

typedef struct {
    uint32_t layout;
    uint32_t model_hash;  /* first 32 bits of the model's SHA-256 */
    uint32_t preset_hash; /* first 32 bits of the preset's SHA-256 */
    float sampling_period_s;
    float reference_current_A; /* strongest current that is ever allowed */
    float current_growth_A; /* most that a charging current may grow by in one period */
    float completion_soc;
    float soc_error; /* by which the cell may be fuller than counted, when one state decides */
    rcbf_constants_t rcbf;
    plausibility_t plausibility;
    thermal_constants_t thermal;
    family_constants_t family;
    planner_constants_t planner;
    kan_model_t kan;
} bms_calibration_t;

/* True when the layout is this firmware's and every number is usable. */
bool calibration_is_valid(const bms_calibration_t *calibration);

/* The calibration that is compiled in; generated/calibration_default.c. */
extern const bms_calibration_t BMS_DEFAULT_CALIBRATION;

#ifdef __cplusplus
}
#endif

#endif
