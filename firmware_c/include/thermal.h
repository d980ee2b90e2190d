/* The surface temperature that the heat of the current implies.
 *
 * A second source beside the sensor: the cell's linear two-mass model, driven by measured current
 * and coolant temperature. It is no estimator; it only says how cold the surface cannot be. */
#ifndef THERMAL_H
#define THERMAL_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* For one period: rise <- transition rise + gain_K_per_W heat + gain_coolant (coolant - start);
 * index 0 is the core, 1 the surface, temperatures are above that of the surface at the start. */
typedef struct {
    float transition[4]; /* row by row */
    float gain_K_per_W[2];
    float gain_coolant[2];
    float ohmic_resistance_ohm;
    float entropic_coefficient_V_per_K;
    float error_bound_K; /* of the predicted surface within the modelled uncertainty */
} thermal_constants_t;

typedef struct {
    bool is_known;
    float start_K;
    float core_rise_K;
    float surface_rise_K;
} thermal_t;

bool thermal_constants_are_valid(const thermal_constants_t *constants);

/* The next readings are those of a cell at rest. */
void thermal_reset(thermal_t *thermal);

/* One period in which the current flowed, with the readings at its end. */
void thermal_step(thermal_t *thermal, const thermal_constants_t *constants, float current_A,
                  float surface_temperature_K, float coolant_temperature_K);

/* What the heat makes of the surface; far below any reading before the first step. */
float thermal_predicted_surface_K(const thermal_t *thermal);

/* Coldest that the surface can be; far below any reading before the first step. */
float thermal_coldest_surface_K(const thermal_t *thermal, const thermal_constants_t *constants);

#ifdef __cplusplus
}
#endif

#endif
