/* Cells in series under one current: each has its own bounds, and the weakest governs.
 *
 * Every cell's readings give an interval of currents that is sufficient for that cell, whatever the
 * current inside of it. The pack's current is the one in all intervals that is nearest to the
 * reference; the decision names the cell and the constraint that it is from. All cells go by one
 * calibration. All state is in the caller's pack_t; there is no allocation and no clock.
 */
#ifndef PACK_H
#define PACK_H

#include <stdbool.h>
#include <stdint.h>

#include "bms.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Most cells in series; a build for a small board sets less. */
#ifndef BMS_MAX_CELLS
#define BMS_MAX_CELLS 192
#endif

/* Most cells of a calibration with a stated family, whose observer takes more state for each. */
#ifndef BMS_MAX_FAMILY_CELLS
#define BMS_MAX_FAMILY_CELLS 192
#endif

/* In place of a thermistor's number: the cell has none of its own. */
#define PACK_NO_THERMISTOR 255

/* In place of a cell's number: none. */
#define PACK_NO_CELL 255

/* Bound on a cell without a thermistor, beside what its own current and voltage tell. */
typedef struct {
    float resistance_factor; /* greatest resistance of a cell over that of the calibration */
    float soc_error;         /* by which a cell may be emptier than counted */
    float voltage_error_V;   /* of its voltage's reading, and of its open-circuit voltage */
    float current_error_A;   /* of the current's reading */
    float surface_K; /* surface above the prediction: start, disturbance, neighbours, coolant */
    float surface_K_per_W; /* and for each watt of the greatest heat so far: its other parameters */
    float estimate_K;      /* what the core's uncertainty is worth, as kelvins of the surface */
} pack_bare_t;

typedef struct {
    const bms_calibration_t *calibration; /* must outlive the pack_t */
    uint32_t cells;
    uint32_t thermistors;
    const uint8_t *thermistor_of; /* for each cell; read by pack_init only */
    pack_bare_t bare;             /* used where a cell has no thermistor */
} pack_config_t;

/* The readings of one period. A reading that is not available is NaN. Along the string the coolant
 * is taken to warm evenly. */
typedef struct {
    float current_A;
    const float *voltage_V;             /* of each cell */
    const float *surface_temperature_K; /* of each thermistor */
    float coolant_in_K;
    float coolant_out_K;
    float cooling_power_W; /* of one cell, in the mean */
    bool charge;           /* asked for */
    float reference_current_A;
    const float *plug_in_soc; /* of each cell; read where a charge is asked for */
    const float *bled_soc;    /* of each cell, since the last charge; NULL for none */
} pack_readings_t;

typedef struct {
    float open_circuit_voltage_V; /* of its state of charge */
    float surface_temperature_K;  /* measured and no colder than the heat allows, or the bound */
    float greatest_heat_W;        /* of a cell without a thermistor, so far */
    soc_t soc;                    /* no less than the cell's, wherever it was told or counted from */
    float untold_soc;             /* by which the charge began above what was told */
    history_t history;
    thermal_t thermal;
    kan_estimate_t estimate;
    rcbf_steadier_t steadier;
    uint8_t ocv_segment; /* of the table, where the last search ended */
    uint8_t decision_segment;
    uint8_t bare_segment;
    uint8_t thermistor;
} pack_cell_t;

typedef struct {
    rcbf_decision_t decision; /* its margins are those of the cell */
    uint8_t cell;             /* that the current is from; PACK_NO_CELL where none limits it */
} pack_decision_t;

typedef struct {
    const bms_calibration_t *calibration;
    bms_state_t state;
    uint32_t cells;
    uint32_t thermistors;
    bool may_start; /* the request has been off since start-up or the last charge */
    bool soc_known;
    pack_bare_t bare;
    monitor_t monitor;
    uint8_t symptom_cell; /* the first with a symptom of the last period; 0 for one that all share */
    uint8_t limit_cell;   /* that kept the current from growing freely, last */
    rcbf_active_t limit;
    float growth_A; /* most that the command may grow by in the coming period */
    float command_A;
    float coolant_in_K; /* last usable readings */
    float coolant_out_K;
    pack_decision_t decision;
    pack_cell_t cell[BMS_MAX_CELLS];
    family_t family[BMS_MAX_FAMILY_CELLS];
} pack_t;

/* A missing or invalid calibration, no cell or more than fit, or a map that is none lead to the fault
 * state, for good. A stated family needs a thermistor at each cell. */
void pack_init(pack_t *pack, const pack_config_t *config);

/* Runs one control period. Any reading that is no number or implausible, of any cell, allows no
 * current. */
void pack_step(pack_t *pack, const pack_readings_t *readings);

/* The decision that one cell by itself would have come to in the last period, for the readings that
 * pack_step was given and a reference; what it leaves of each constraint is in its margins. */
rcbf_decision_t pack_cell_decision(const pack_t *pack, const pack_readings_t *readings,
                                   uint32_t cell, float reference_current_A);

/* State of charge of the emptiest and the fullest cell. */
range_t pack_soc_spread(const pack_t *pack);

#ifdef __cplusplus
}
#endif

#endif
