/* State of charge by coulomb counting, with compensated sums so that float32 loses nothing.
 *
 * The measured and the commanded current are counted side by side, and the fuller count holds: a
 * current sensor that is off by less than the monitor can see would otherwise overfill the cell. */
#ifndef SOC_H
#define SOC_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float soc;
    float lost; /* low-order part that did not fit into soc */
} soc_counter_t;

typedef struct {
    soc_counter_t measured;
    soc_counter_t commanded;
    float soc; /* the fuller of the two */
} soc_t;

/* Adds a change, and what earlier ones lost. */
void soc_add(soc_counter_t *counter, float change);

void soc_set(soc_t *state, float soc);

/* Counts one period of constant currents (negative while charging). */
void soc_count(soc_t *state, float measured_A, float commanded_A, float period_s,
               float capacity_As);

#ifdef __cplusplus
}
#endif

#endif
