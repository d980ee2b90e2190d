/* The baselines of bms/baselines that a campaign counts beside the firmware. */
#ifndef BASELINES_H
#define BASELINES_H

#include "cell.h"

/* What S-CBF and CC-CV take from the nominal cell and the preset. */
typedef struct {
    double strongest_current_A;
    double capacity_As;
    double ohmic_resistance_ohm;
    double max_voltage_V;
    double max_soc;
    double max_surface_temperature_K;
    double alpha1_per_s;
    double alpha3_per_s2;
    double a4_per_s2;
    double a6_per_s2;
    double a9_K_per_A2s2;
    double a10_K_per_Ws2;
    double charging_voltage_V;
    double reached_V;      /* voltage that counts as the charging voltage */
    double tail_current_A; /* strength at which a charge at constant voltage ends */
    double cut_back_begin_K;
    double cut_back_end_K;
} baseline_constants_t;

/* Surface barrier in cascade on the true state; 0 A when nothing is allowed. */
double baseline_s_cbf_A(const baseline_constants_t *constants, const cell_t *nominal,
                        const cell_state_t *state, double cooling_power_W, double reference_A);

/* Constant current, constant voltage, cut back by surface temperature, on measurements. */
double baseline_cc_cv_A(const baseline_constants_t *constants, double current_A, double voltage_V,
                        double surface_temperature_K, double reference_A);

#endif
