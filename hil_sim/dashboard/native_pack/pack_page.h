/* What the page calls of its module for packs: one charge of cells in series, in closed loop. All
 * state is in the memory of the module. The page writes the scenario to its place, after it has
 * compared the sizes. */
#ifndef PACK_PAGE_H
#define PACK_PAGE_H

#include <stdint.h>

#include "pack_scenario.h"

#ifdef __wasm__
#define PAGE(name) __attribute__((export_name(#name)))
#else
#define PAGE(name)
#endif

/* What is true of a cell. */
typedef struct {
    double soc;
    double core_temperature_K;
    double surface_temperature_K;
    double voltage_V;
    cell_peaks_t peaks;
} pack_page_cell_t;

typedef struct {
    double time_s;
    double current_A;
    double outcome;    /* pack_outcome_t */
    double governing;  /* cell; PACK_NO_CELL where none limits the current */
    double constraint; /* rcbf_active_t */
    pack_page_cell_t cell[PACK_PAGE_MOST_CELLS];
} pack_page_look_t;

PAGE(scenario_address) void *scenario_address(void);
PAGE(scenario_size) uint32_t scenario_size(void);
PAGE(begin) void begin(void);

/* Runs up to so many periods; not 0 while the charge goes on. */
PAGE(advance) uint32_t advance(uint32_t periods);

/* A pack_page_look_t. */
PAGE(look) const void *look(void);

#endif
