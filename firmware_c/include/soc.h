/* State of charge by coulomb counting, with a compensated sum so that float32 loses nothing. */
#ifndef SOC_H
#define SOC_H

typedef struct {
    float soc;
    float lost; /* low-order part that did not fit into soc */
} soc_t;

void soc_set(soc_t *counter, float soc);

/* Counts one period of a constant current (negative while charging). */
void soc_count(soc_t *counter, float current_A, float period_s, float capacity_As);

#endif
