/* Standard normal numbers as numpy.random.default_rng draws them: SeedSequence, PCG64 and the
 * ziggurat of its Generator, so that a run here has the sensor noise of the same seed there.
 *
 * Sources: M. O'Neill, PCG (2014), XSL-RR 128/64, and her seed_seq; G. Marsaglia and W. W. Tsang,
 * The Ziggurat Method (2000). numpy's tables come from the caller, see hil_sim/dashboard/build.
 */
#ifndef NORMALS_H
#define NORMALS_H

#include <stdint.h>

#define NORMALS_STRIPS 256
#define NORMALS_MOST_SEED_WORDS 4

/* Of every strip: the largest 52-bit number that is accepted at once is one below `inside`; width
 * of a step of that number; density at the strip's edge. `tail` is where the last strip ends. */
typedef struct {
    uint64_t inside[NORMALS_STRIPS];
    double step[NORMALS_STRIPS];
    double density[NORMALS_STRIPS];
    double tail;
    double tail_inverse;
} normals_tables_t;

typedef struct {
    const normals_tables_t *tables;
    uint64_t state[2]; /* low half first */
    uint64_t increment[2];
} normals_t;

/* The generator of SeedSequence(seed).spawn(child + 1)[child]. */
void normals_begin(normals_t *normals, const normals_tables_t *tables, uint32_t seed,
                   uint32_t child);

double normals_next(normals_t *normals);

#endif
