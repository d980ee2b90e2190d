/* Robust control-barrier quadratic program of one variable, solved in closed form.
 *
 * minimise (u - reference)^2 over reference <= u <= 0 and four constraints that are concave in u
 * (docs/theory.md). Each admits an interval; the optimum is the end of their intersection that is
 * nearest to the reference. Charging currents are negative.
 */
#ifndef RCBF_H
#define RCBF_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define RCBF_MAX_OCV_POINTS 64
#define RCBF_CONSTRAINTS 4

/* A temperature as a sum, because float32 near 300 K has steps of 3e-5 K: where little current is
 * left, such a step moves the decision by tens of milliamperes. What comes in float32 already, as
 * from a sensor, has no low part. */
typedef struct {
    float high_K;
    float low_K;
} rcbf_temperature_t;

/* Coefficients a1..a10 and delta4 as in bms/barrier/constants.py. */
typedef struct {
    rcbf_temperature_t max_core_temperature_K;
    rcbf_temperature_t max_surface_temperature_K;
    float alpha2_per_s;
    float alpha3_per_s2;
    float a1_per_s;
    float a4_per_s2;
    float a6_per_s2;
    float a10_K_per_Ws2;
    float delta4_K_per_s2;
    float core_uncertainty_K_per_s;
    float core_margin_K_per_s;
    float surface_margin_K_per_s2;
    float estimation_error_bound_K;
    float a2_per_As;
    float a3_K_per_A2s;
    float a8_per_As2;
    float a9_K_per_A2s2;
    float capacity_As;
    float ohmic_resistance_ohm;
    float max_voltage_V;
    float max_soc;
    float alpha1_per_s;
    float soc_uncertainty_per_s;
    float voltage_margin_V;
    float soc_margin_per_s;
    uint32_t ocv_points;
    float ocv_soc[RCBF_MAX_OCV_POINTS];
    float ocv_V[RCBF_MAX_OCV_POINTS];
} rcbf_constants_t;

typedef struct {
    rcbf_temperature_t core_temperature_K; /* the estimate */
    rcbf_temperature_t surface_temperature_K;
    rcbf_temperature_t coolant_temperature_K;
    float cooling_power_W;
    float soc;
    float reference_current_A;
} rcbf_input_t;

typedef enum {
    RCBF_NONE = 0,
    RCBF_VOLTAGE = 1,
    RCBF_SOC = 2,
    RCBF_CORE = 3,
    RCBF_SURFACE = 4,
    RCBF_INFEASIBLE = 5,
    RCBF_INVALID = 6,
    RCBF_MAP = 7,         /* the current map */
    RCBF_CORE_UNKNOWN = 8 /* it is not known yet how hot the core can be */
} rcbf_active_t;

typedef struct {
    float current_A;
    bool feasible;
    rcbf_active_t active;
    float lower_A;
    float upper_A;
    float margins[RCBF_CONSTRAINTS]; /* left-hand sides at current_A: voltage, soc, core, surface */
} rcbf_decision_t;

/* What the core's and the surface's condition leave at 0 A, with less of the readings' noise in it. */
typedef struct {
    float core_K_per_s;
    float surface_K_per_s2;
} rcbf_steadier_t;

/* True when all constants are finite, those that must be positive are, and the table rises. */
bool rcbf_constants_are_valid(const rcbf_constants_t *constants);

/* Open-circuit voltage in V, linear between table points, constant beyond them. */
float rcbf_open_circuit_voltage_V(const rcbf_constants_t *constants, float soc);

/* The same, for states of charge that change little from call to call: `segment` is where the last
 * search ended, at first 0. */
float rcbf_open_circuit_voltage_near_V(const rcbf_constants_t *constants, float soc,
                                       uint8_t *segment);

/* Charging current. 0 A with feasible == false when no current satisfies all constraints
 * (RCBF_INFEASIBLE) or an input is not finite, out of any physical range, or the reference is
 * above 0 A (RCBF_INVALID). */
rcbf_decision_t rcbf_solve(const rcbf_constants_t *constants, const rcbf_input_t *input);

/* Nothing is remembered. */
void rcbf_steadier_reset(rcbf_steadier_t *steadier);

/* The same, for one period after the other, where the open-circuit voltage of the input's state of
 * charge is known: noise of the readings moves the current less. No stronger current than that of
 * rcbf_solve. */
rcbf_decision_t rcbf_solve_steadily(const rcbf_constants_t *constants, const rcbf_input_t *input,
                                    float open_circuit_voltage_V, rcbf_steadier_t *steadier);

#ifdef __cplusplus
}
#endif

#endif
