/* State of function: the strongest charging current that may be held from now on for some time.
 *
 * One cell stands for all: it has the hottest surface, the hottest estimate, the fullest count, the
 * warmest coolant, and the constants of the worst cell. What it admits every cell admits, since each
 * condition falls with each of them (docs/pack.md has the bounds). Unknown means 0 A.
 */
#ifndef PACK_FUNCTION_H
#define PACK_FUNCTION_H

#include <stdbool.h>

#include "pack.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the time ahead makes of a reading; hil_sim/studies/pack/function.py computes it. Each is a
 * bound over all cells, and shares are of a difference of two temperatures. */
typedef struct {
    float horizon_s;             /* 0 for one that is not known: it allows 0 A */
    float core_above_estimate_K; /* that a core may be now */
    float core_K_per_W;          /* by which a core warms at most, for each watt of its heat */
    float core_K;                /* and by what is not modelled */
    float surface_per_core;      /* of the way from surface to core that the surface goes */
    float surface_per_coolant;   /* of that to a cooler coolant */
    float surface_per_warmer_coolant;
    float surface_K;           /* error of the reading, and what is not modelled */
    float coolant_per_core;    /* of the way from coolant to core that the coolant goes */
    float coolant_per_surface; /* of that to a surface that does not warm */
    float coolant_K;           /* error of the reading, unevenness, what is not modelled */
} pack_horizon_t;

/* The cell that stands for all. NaN where any cell's is none. */
typedef struct {
    float soc;
    float surface_K;
    float estimate_K;
    float coolant_K;
} pack_worst_t;

pack_worst_t pack_worst(const pack_t *pack);

/* Strongest current, 0 A or negative, after a period of the pack whose worst cell is given. 0 A where the pack may not charge
 * (fault, a symptom that stops, full, no charge yet whose states of charge would be known), for a
 * stated family, and for anything that is no number. */
float pack_function_A(const pack_t *pack, const pack_worst_t *worst,
                      const pack_horizon_t *horizon);

#ifdef __cplusplus
}
#endif

#endif
