/* What the page calls of its module: one charge, and that of S-CBF beside it. All state is in the
 * memory of the module, of which a page makes one for each charge that it wants to have.
 *
 * The page writes scenario and settings to the places that are given here, after it has compared
 * the sizes; it reads and writes readings, values of signals and frames in the same way.
 */
#ifndef PAGE_H
#define PAGE_H

#include <stdint.h>

#include "cell.h"

#ifdef __wasm__
#define PAGE(name) __attribute__((export_name(#name)))
#else
#define PAGE(name)
#endif

/* What is true, whatever the sensors and the ECU say. */
typedef struct {
    double soc;
    double core_temperature_K;
    double surface_temperature_K;
    double coolant_temperature_K;
    double voltage_V;
    double current_A;
    double cooling_power_W;
    cell_peaks_t peaks;
} page_truth_t;

PAGE(scenario_address) void *scenario_address(void);
PAGE(scenario_size) uint32_t scenario_size(void);
PAGE(settings_address) void *settings_address(void);
PAGE(settings_size) uint32_t settings_size(void);
PAGE(readings_address) void *readings_address(void);
PAGE(values_address) void *values_address(void);
PAGE(frames_address) void *frames_address(void);
PAGE(frame_size) uint32_t frame_size(void);

/* Whether the firmware takes the calibration of the scenario. */
PAGE(is_accepted) uint32_t is_accepted(void);

/* The parts of a period, as in session.h. */
PAGE(begin) void begin(void);
PAGE(start_ecu) void start_ecu(void);
PAGE(measure) void measure(void);
PAGE(publish) uint32_t publish(uint32_t has_mode);
PAGE(exchange) uint32_t exchange(uint32_t count);
PAGE(hear) double hear(uint32_t count);
PAGE(obey) double obey(double usable_A);
PAGE(supply) void supply(double current_A);
PAGE(cool) void cool(double full_power_W);
PAGE(advance) void advance(void);

/* The command in sequence that the last frames brought; NULL for none. */
PAGE(told) const void *told(void);

/* A page_truth_t. */
PAGE(look) const void *look(void);

/* S-CBF on the cell of the settings from its start, whenever in the charge it is called. */
PAGE(begin_beside) void begin_beside(void);

/* One period of it; its charge_outcome_t. */
PAGE(advance_beside) uint32_t advance_beside(void);

/* The page_truth_t of its cell. */
PAGE(look_beside) const void *look_beside(void);

#endif
