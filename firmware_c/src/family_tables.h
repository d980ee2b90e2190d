/* What the sources of a family share: tables, bounds on the heat, and what the surface tells. */
#ifndef FAMILY_TABLES_H
#define FAMILY_TABLES_H

#include "family.h"

/* Greatest ohmic resistance of a cell whose coldest part has this temperature. */
float family_resistance_ohm(const family_constants_t *constants, float temperature_K);

/* Cell of the grid that a state of charge is in. */
uint32_t family_soc_cell(float soc);

/* State of charge whose open-circuit voltage is this one, or the table's end that is nearest. */
float family_soc_at(const rcbf_constants_t *cell, float voltage_V);

/* Greatest value of any cell of the grid from the first to the one before the end. */
float family_greatest(const float *cells, uint32_t first, uint32_t end);

/* Greatest slope and entropic coefficient between two states of charge, into the family. */
void family_look_up_cells(family_t *family, const family_constants_t *constants, float soc_low,
                          float soc_high);

/* Rise of the branches' voltages at a strength that holds on, at most. */
float family_rise_V_per_s(const family_t *family, const family_constants_t *constants,
                          float strength_A);

/* Strongest current that the map allows. */
float family_mapped_A(const family_map_t *map, float temperature_K, float soc);

/* Upper bound on the heat of a strength whose polarisation no stronger one than `past_A` left, for
 * a measured overpotential at another strength. */
typedef struct {
    float overpotential_V;
    float at_least_A; /* the measured strength, within its error */
    float at_most_A;
    float past_A;
    float resistance_ohm;
    float least_resistance_ohm;
    float polarisation_ohm;
} family_heat_t;

/* That of the cell at hand, from what the observer has made of the last readings, at a strength. */
family_heat_t family_heat(const family_t *family, const family_constants_t *constants,
                          float strength_A);

/* From the hottest core that is possible, by observer or estimate, to the limit. */
float family_core_room_K(const family_t *family, const family_constants_t *constants,
                         const rcbf_constants_t *cell, const family_reading_t *reading);

float family_measured_heat_W(const family_heat_t *heat, float strength_A);
float family_assumed_heat_W(const family_heat_t *heat, float strength_A);

/* Largest strength at which each of these bounds is no more than limit_W - slope a - square a^2;
 * negative where there is none. */
float family_measured_strength_A(const family_heat_t *heat, float square, float slope,
                                 float limit_W);
float family_assumed_strength_A(const family_heat_t *heat, float square, float slope,
                                float limit_W);

/* Whether a reading of the current is none but for its error. */
bool family_is_at_rest(const family_constants_t *constants, const family_reading_t *reading);

/* Take one more reading at rest, or in a charge, into the bound on the core. */
void family_look_at_rest(family_t *family, const family_constants_t *constants,
                         const rcbf_constants_t *cell, const family_reading_t *reading);
void family_look_in_charge(family_t *family, const family_constants_t *constants,
                           const rcbf_constants_t *cell, const family_reading_t *reading);

#endif
