/* Linear thermal model of a cell, two masses (core and surface), over one sampling period.
 *
 * Temperatures enter as distances from the coolant, which is measured; the current of a sample
 * acts until the next one. The reversible heat is taken at the estimated core temperature.
 */
#ifndef THERMAL_H
#define THERMAL_H

/* Places in a row of inputs, the same as those of the KAN. */
enum { INPUT_CURRENT, INPUT_COOLING_POWER, INPUT_SURFACE, INPUT_COOLANT, INPUTS };

typedef struct {
    float transition[2][2];
    float heat_gain_K_per_W[2];
    float ohmic_resistance_ohm;
    float entropic_coefficient_V_per_K;
} thermal_t;

/* Estimated temperatures, and what was measured with the last sample. */
typedef struct {
    float core_K;
    float surface_K;
    float current_A;
    float coolant_K;
} thermal_state_t;

/* Thermal rest at the surface temperature of the first sample. */
thermal_state_t thermal_rest(const float *inputs);

/* Heat in W at the state's current and core temperature, for a given ohmic resistance. */
float thermal_heat_W(const thermal_t *cell, const thermal_state_t *state, float resistance_ohm);

/* Temperatures one period later, under the heat given, and the new sample's measurements. */
void thermal_advance(const thermal_t *cell, thermal_state_t *state, float heat_W,
                     const float *inputs);

#endif
