/* A family of cells in place of one: what is known of the cell at hand, and the current it allows.
 *
 * Nothing is assumed of a parameter but its interval. From the readings follow bounds that hold for
 * each cell of the family: on the state of charge, on the heat (from the measured voltage) and on the
 * core temperature (an observer that no core is hotter than). docs/family.md has the derivation.
 * Strengths are charging currents as positive numbers.
 */
#ifndef FAMILY_H
#define FAMILY_H

#include <stdbool.h>
#include <stdint.h>

#include "rcbf.h"
#include "soc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FAMILY_MAX_BRANCHES 3
#define FAMILY_SOC_CELLS 32
#define FAMILY_TEMPERATURES 12
#define FAMILY_MAP_TEMPERATURES 8
#define FAMILY_MAP_CHARGES 8

/* A branch of the polarisation: shares of its way to the cell's current that the current in its
 * resistance goes in a period, at its slowest and at its fastest. */
typedef struct {
    float slow;
    float fast;
    float resistance_ohm;  /* greatest */
    float drift_ohm_per_s; /* that over the least time constant */
} family_branch_t;

/* Strongest current over temperature and state of charge, linear between the points. */
typedef struct {
    uint32_t temperatures;
    uint32_t charges;
    float temperature_K[FAMILY_MAP_TEMPERATURES];
    float soc[FAMILY_MAP_CHARGES];
    float strength_A[FAMILY_MAP_TEMPERATURES * FAMILY_MAP_CHARGES]; /* row by temperature */
} family_map_t;

typedef struct {
    uint32_t is_stated; /* 0: the preset describes one cell, and the rest is not used */
    /* State of charge. */
    float plug_in_error;
    float least_soc_per_A;    /* in one period, of the largest cell */
    float greatest_soc_per_A; /* of the smallest */
    float hold_soc_per_A;     /* in the longest hold, of the smallest */
    float ocv_error_V;
    float ocv_slope_V[FAMILY_SOC_CELLS]; /* greatest in each cell of a grid from 0 to 1 */
    float entropic_V_per_K[FAMILY_SOC_CELLS];
    /* Resistance: greatest at each temperature of a grid and at all warmer ones. */
    float coldest_K;
    float per_step_K;
    float resistance_ohm[FAMILY_TEMPERATURES];
    float least_resistance_ohm;
    float polarisation_ohm;
    float relaxation; /* share of the polarisation at plug-in that is left after a period, at most */
    float rest_polarisation_V; /* of either sign, at plug-in or after a load */
    float rest_drift_per_s;
    uint32_t branches;
    family_branch_t branch[FAMILY_MAX_BRANCHES];
    /* Core: greatest resistance to the surface, and greatest or least heat capacity. */
    float inner_K; /* below the limit, that the core is kept */
    float outflow_W_per_K;
    float gain_W_per_K;
    float core_K_per_J; /* rate of the largest core for one watt, for the report */
    float heating_K_per_W; /* in one period */
    float cooling_K_per_W;
    float coldest_core_K;
    float disturbance_W;
    float disturbance_W_per_A;
    float disturbance_W_per_A2;
    float hold_W; /* what a hold can take from the outflow */
    float estimate_error_K; /* FLT_MAX where nobody vouches for the estimate */
    /* At rest the surface tells the core: above it by these times its rise and its gap. */
    uint32_t rest_periods;
    float per_surface_rise;
    float per_coolant_gap;
    float rest_error_K;
    /* And in a charge how hot it is at least: with the least of both, a fall with the most. */
    uint32_t charge_periods;
    float least_per_surface_rise;
    float most_per_surface_fall;
    float least_per_coolant_gap;
    float charge_error_K;
    /* Charger. */
    float supply_tolerance;
    float supply_share; /* of the way to the command that the slowest goes in a period */
    float period_s;
    /* Readings. */
    float current_error_A;
    float voltage_error_V;
    float surface_error_K;
    float coolant_error_K;
    float hold_s;
    float full_ocv_V; /* open-circuit voltage of the least full cell that is full enough */
    uint32_t full_periods;
    family_map_t map;
} family_constants_t;

typedef struct {
    float current_A;
    float voltage_V;
    float surface_temperature_K;
    float coolant_temperature_K;
    float estimated_core_K;
    float command_A; /* in force when the readings were taken */
    bool is_usable;  /* all readings are fresh and plausible */
    bool is_charging;
} family_reading_t;

/* Surface and its gap to the coolant over some periods. */
typedef struct {
    uint32_t count;
    float first_K;
    float sum_K; /* of what is above the first */
    float gap_K; /* sum */
} family_window_t;

typedef struct {
    soc_counter_t soc_low;
    soc_counter_t soc_high;
    bool soc_known;
    uint8_t first_cell; /* of the grid's cells that the state of charge may be in */
    uint8_t end_cell;   /* past the last of them; 0 where it is not known */
    uint8_t ocv_segment; /* of the table, where the last search ended */
    uint32_t bridged;             /* periods without usable readings, in a row */
    float strength_A; /* at the last reading */
    float strong_A[FAMILY_MAX_BRANCHES]; /* what flows in each branch's resistance, at most */
    float weak_A[FAMILY_MAX_BRANCHES];   /* and at least */
    float strongest_A;                   /* of the cell's current and those at most */
    float polarisation_V;                /* of all branches together, at most */
    float rest_polarisation_V;
    float commands_A[2]; /* strengths, the last one first */
    float supply_low_A;
    float supply_high_A;
    float steady_voltage_V; /* at 0 A, with less of the readings' noise in it */
    float steadied_V;       /* how much more of the voltage is believed than was read */
    float overpotential_V; /* at most */
    float entropic_V;      /* dU/dT times temperature, at most */
    float cells_slope_V; /* greatest of these grid cells */
    float cells_entropic_V_per_K;
    float ocv_slope_V;     /* at most */
    float entropic_V_per_K; /* at most */
    float unknown_ocv_slope_V; /* both where the state of charge is not known */
    float unknown_entropic_V_per_K;
    float resistance_ohm; /* at most, at the last reading */
    float heat_W;          /* at most, in the last period */
    float surface_temperature_K;
    bool core_is_known;
    float core_room_K; /* from the hottest possible core to the limit */
    family_window_t rest;
    family_window_t charge;
    uint32_t full_count;
} family_t;

bool family_constants_are_valid(const family_constants_t *constants);

/* Nothing is known of the cell. */
void family_reset(family_t *family, const family_constants_t *constants);

/* A charge begins at this state of charge, more or less; the voltage of a cell at rest tells it too.
 */
void family_begin(family_t *family, const family_constants_t *constants,
                  const rcbf_constants_t *cell, float plug_in_soc,
                  const family_reading_t *reading);

/* Takes the readings of one period. What follows is asked with the same readings. */
void family_observe(family_t *family, const family_constants_t *constants,
                    const rcbf_constants_t *cell, const family_reading_t *reading);

/* Charging current nearest to the reference that is safe for every cell of the family. */
rcbf_decision_t family_decide(const family_t *family, const family_constants_t *constants,
                              const rcbf_constants_t *cell, const family_reading_t *reading,
                              float reference_current_A);

/* Whether no cell of the family is less full than the preset asks for. */
bool family_is_full(const family_t *family, const family_constants_t *constants,
                    float completion_soc);

/* Whether current flows into a cell whose core may be above its limit by more than an overshoot. */
bool family_is_too_hot(const family_t *family, const family_constants_t *constants,
                       const rcbf_constants_t *cell, const family_reading_t *reading,
                       float overshoot_K);

/* Whether the measured current can be what a charger of the family makes of the commands, to
 * within a deviation. */
bool family_supply_is_plausible(const family_t *family, const family_constants_t *constants,
                                float current_A, float deviation_A);

/* Whether the voltage can be that of a cell of the family, to within a deviation. */
bool family_voltage_is_plausible(const family_t *family, const family_constants_t *constants,
                                 const rcbf_constants_t *cell, const family_reading_t *reading,
                                 float deviation_V);

#ifdef __cplusplus
}
#endif

#endif
