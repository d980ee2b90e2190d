/* One charge in closed loop, as hil_sim/run/charge.py runs it over a bus: plant, sensors, charger and
 * controller. Random numbers come from the caller. */
#ifndef CHARGE_H
#define CHARGE_H

#include "baselines.h"
#include "cell.h"
#include "ecu_link.h"

#define CHARGE_SUB_STEPS 10

typedef enum {
    CHARGE_RUNNING = 0,
    CHARGE_COMPLETE = 1,
    CHARGE_FAULT = 2,
    CHARGE_TIME_LIMIT = 3,
    CHARGE_NOT_READY = 4
} charge_outcome_t;

typedef enum { CHARGE_KAN_RCBF = 0, CHARGE_S_CBF = 1, CHARGE_CC_CV = 2 } charge_controller_t;

/* reading = round(truth + bias + noise) to the resolution; 0 means no rounding */
typedef struct {
    double resolution;
    double noise_std;
} charge_sensor_t;

/* Bound on the disturbance of the core over the current; knots have the one at the reference. */
typedef struct {
    double constant_K_per_s;
    double per_A_K_per_As;
    double per_A2_K_per_A2s;
    double at_reference_K_per_s;
} charge_core_bound_t;

/* What all runs of a campaign have in common. */
typedef struct {
    double period_s;
    double max_time_s;
    double reference_current_A;
    bool has_mode;    /* the firmware is asked for one */
    uint32_t mode;    /* codec_mode_t */
    double full_by_s; /* from the edge on; negative: no time is asked for */
    double completion_soc;
    double cooling_band_K;
    double noise_cutoff; /* of the standard normal numbers */
    uint32_t off_periods;   /* before the charge is requested */
    uint32_t ready_periods; /* after which an ECU that is not ready is given up */
    uint32_t starting_periods; /* the same while it says that it is still starting */
    cell_t nominal;         /* the cell that the controllers know */
    charge_sensor_t sensors[LINK_READINGS];
    charge_core_bound_t core_bound;
    link_signals_t signals;
    baseline_constants_t baselines;
} charge_scenario_t;

/* Largest values of a charge, at any sub-step. */
typedef struct {
    cell_peaks_t cell;
    double estimate_error_K;     /* of the firmware, while charging, at the control periods */
    cell_state_t model_error;    /* |true less nominal rates|, disturbance included */
    double surface_error_slope_K_per_s2;
} charge_peaks_t;

/* True less nominal rates are these times what is behind them, plus the disturbance. */
typedef struct {
    double soc_per_As;           /* current */
    double core_gap_per_s;       /* core less surface */
    double surface_core_per_s;   /* core less surface */
    double surface_gap_per_s;    /* surface less coolant */
    double coolant_gap_per_s;    /* surface less coolant */
    double coolant_K_per_J;      /* cooling power */
} charge_differences_t;

typedef struct {
    const charge_scenario_t *scenario;
    charge_controller_t controller;
    cell_t cell;
    double full_cooling_W;        /* of the cooler */
    double coolant_floor_K;       /* over the band above it the cooling fades out */
    double plug_in_soc;           /* as the charger tells it */
    double bias[LINK_READINGS];   /* of the sensors */
    double supply_gain;           /* current supplied over the one commanded */
    double supply_share;          /* of the way to a command in a period, by the charger's lag */
    bool watches_model_error;
    cell_memory_t memory;
    cell_state_t knot; /* disturbance at the present instant, the core's at the reference current */
    double current_A;
    double lagged_A; /* current before the charger's gain */
    double command_A;
    double cooling_power_W; /* in the present period */
    charge_differences_t differences;
    charge_outcome_t outcome;
    uint32_t periods;
    bool requested;
    uint32_t edge_period;  /* of the first request */
    double time_s;         /* of the last decision, since the edge */
    double first_derate_s; /* negative: never */
    uint32_t first_fault;  /* FAULT_NONE: none */
    uint32_t infeasible_periods;
    uint32_t stops; /* from a current to a command of 0 A, while the charge goes on */
    double surface_error_K_per_s; /* at the last sub-step; NaN before the first */
    double counted_soc;           /* by CC-CV, from its measurements */
    double predicted_s;           /* to full, as the firmware told last; negative: not told */
    double heat_J;                /* that the cell has produced */
    double core_sum_K;            /* of the control periods since the edge */
    charge_peaks_t peaks;
    link_t link;
} charge_t;

/* Prepares a charge whose members from scenario to knot are set and whose others are zero. The calibration is the firmware's and must outlive the charge. */
void charge_begin(charge_t *charge, const bms_calibration_t *calibration);

/* Runs up to `periods` control periods, with LINK_READINGS standard normal numbers for each and
 * the disturbance (soc, core, surface, coolant) at the end of each of its CHARGE_SUB_STEPS
 * sub-steps. */
void charge_advance(charge_t *charge, const double *normals, const double *knots,
                    uint32_t periods);

/* Makes the surface disturbance change by no more than largest_change from knot to knot. */
void charge_limit_slope(double *knots, uint32_t count, double before, double largest_change);

#endif
