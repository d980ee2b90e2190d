#include "thermal_step.h"

#include <math.h>
#include <string.h>

/* The series is short where no entry exceeds this; a longer step is made of halves. */
#define SMALL 0.25
#define TERMS 16

typedef struct {
    double at[3][3];
} matrix_t;

static matrix_t product(const matrix_t *a, const matrix_t *b)
{
    matrix_t c;
    for (uint32_t i = 0u; i < 3u; i++) {
        for (uint32_t j = 0u; j < 3u; j++) {
            c.at[i][j] = a->at[i][0] * b->at[0][j] + a->at[i][1] * b->at[1][j] +
                         a->at[i][2] * b->at[2][j];
        }
    }
    return c;
}

/* factor * a + identity */
static matrix_t over_identity(const matrix_t *a, double factor)
{
    matrix_t c;
    for (uint32_t i = 0u; i < 3u; i++) {
        for (uint32_t j = 0u; j < 3u; j++) {
            c.at[i][j] = factor * a->at[i][j] + ((i == j) ? 1.0 : 0.0);
        }
    }
    return c;
}

static double largest(const matrix_t *a)
{
    double found = 0.0;
    for (uint32_t i = 0u; i < 9u; i++) {
        found = fmax(found, fabs(a->at[i / 3u][i % 3u]));
    }
    return found;
}

/* Mean of e^(M t) over t from 0 to 1, that is (e^M - 1) / M. */
static matrix_t mean_exponential(const matrix_t *m)
{
    matrix_t part = *m;
    uint32_t halvings = 0u;
    while (largest(&part) > SMALL) {
        for (uint32_t i = 0u; i < 9u; i++) {
            part.at[i / 3u][i % 3u] *= 0.5;
        }
        halvings++;
    }
    matrix_t mean = over_identity(&part, 1.0 / (double)TERMS);
    for (uint32_t k = TERMS - 1u; k >= 2u; k--) {
        const matrix_t next = product(&part, &mean);
        mean = over_identity(&next, 1.0 / (double)k);
    }
    for (uint32_t i = 0u; i < halvings; i++) {
        const matrix_t change = product(&part, &mean); /* e^part - 1 */
        const matrix_t both = over_identity(&change, 0.5);
        mean = product(&both, &mean);
        for (uint32_t n = 0u; n < 9u; n++) {
            part.at[n / 3u][n % 3u] *= 2.0;
        }
    }
    return mean;
}

void thermal_step(cell_t *cell)
{
    const double core_W_per_K = 1.0 / cell->core_resistance_K_per_W;
    const double coolant_W_per_K = 1.0 / cell->surface_resistance_K_per_W;
    const double core_s = cell->step_s / cell->core_heat_capacity_J_per_K;
    const double surface_s = cell->step_s / cell->surface_heat_capacity_J_per_K;
    const double coolant_s = cell->step_s / cell->coolant_heat_capacity_J_per_K;
    const matrix_t flows = { {
        { -core_W_per_K * core_s, core_W_per_K * core_s, 0.0 },
        { core_W_per_K * surface_s, -(core_W_per_K + coolant_W_per_K) * surface_s,
          coolant_W_per_K * surface_s },
        { 0.0, coolant_W_per_K * coolant_s, -coolant_W_per_K * coolant_s },
    } };
    const matrix_t mean = mean_exponential(&flows);
    const matrix_t change = product(&mean, &flows);
    memset(&cell->thermal, 0, sizeof cell->thermal);
    for (uint32_t i = 0u; i < 3u; i++) {
        cell->thermal.core_gap[i] = change.at[i][0];
        cell->thermal.coolant_gap[i] = change.at[i][2];
        cell->thermal.heat_K_per_W[i] = mean.at[i][0] * core_s;
        cell->thermal.cooling_K_per_W[i] = mean.at[i][2] * coolant_s;
    }
}
