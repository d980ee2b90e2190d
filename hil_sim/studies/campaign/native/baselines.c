#include "baselines.h"

#include <math.h>

static double wanted_A(const baseline_constants_t *k, double reference_A)
{
    return fmin(fmax(reference_A, k->strongest_current_A), 0.0);
}

double baseline_s_cbf_A(const baseline_constants_t *k, const cell_t *nominal,
                        const cell_state_t *state, double cooling_power_W, double reference_A)
{
    const double asked_A = wanted_A(k, reference_A);
    const double slope_K_per_Ws2 = -k->a9_K_per_A2s2 / k->ohmic_resistance_ohm;
    const double room_K_per_s2 = k->a4_per_s2 * (state->core - state->surface) +
                                 k->a6_per_s2 * (state->coolant - state->surface) +
                                 k->alpha3_per_s2 *
                                     (k->max_surface_temperature_K - state->surface) +
                                 k->a10_K_per_Ws2 * cooling_power_W;
    const double heat_W =
        fmin(room_K_per_s2 / slope_K_per_Ws2, k->ohmic_resistance_ohm * (asked_A * asked_A));
    const double voltage_A = -(k->max_voltage_V - cell_open_circuit_voltage_V(nominal, state->soc)) /
                             k->ohmic_resistance_ohm;
    const double soc_A = -k->capacity_As * k->alpha1_per_s * (k->max_soc - state->soc);
    if (heat_W < 0.0) {
        return 0.0;
    }
    const double surface_A = -sqrt(heat_W / k->ohmic_resistance_ohm);
    const double lower_A = fmax(fmax(asked_A, voltage_A), fmax(soc_A, surface_A));
    return (lower_A <= 0.0) ? lower_A : 0.0;
}

double baseline_cc_cv_A(const baseline_constants_t *k, double current_A, double voltage_V,
                        double surface_temperature_K, double reference_A)
{
    const double asked_A = wanted_A(k, reference_A);
    const double change_V = voltage_V - k->charging_voltage_V;
    const double constant_voltage_A = fmin(current_A + change_V / k->ohmic_resistance_ohm, 0.0);
    const double left =
        (k->cut_back_end_K - surface_temperature_K) / (k->cut_back_end_K - k->cut_back_begin_K);
    const double cut_back_A = asked_A * fmin(fmax(left, 0.0), 1.0);
    return fmax(asked_A, fmax(constant_voltage_A, cut_back_A));
}
