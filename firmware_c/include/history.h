/* What the estimator remembers: low-pass filters of current squared and surface temperature. */
#ifndef HISTORY_H
#define HISTORY_H

#include <stdbool.h>
#include <stdint.h>

#include "kan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Periods without usable readings that the filters bridge with the last ones. */
#define HISTORY_MAX_BRIDGED 3

typedef struct {
    float filtered[KAN_MAX_LAGS];
    float current_A;
    float surface_temperature_K;
    uint32_t periods; /* since the start or the last gap, saturating */
    uint32_t bridged;
} history_t;

/* A cell at rest, of which nothing is known yet. */
void history_reset(history_t *history);

/* Takes the readings of one period: the current has flowed since the last one. Readings that are
 * not usable are replaced by the last ones; a longer gap starts the history anew. */
void history_step(history_t *history, const kan_model_t *model, float current_A,
                  float surface_temperature_K, bool is_usable);

/* True while readings come, but a wrong start has not died away yet; never for a model without
 * lagged inputs. */
bool history_is_settling(const history_t *history, const kan_model_t *model);

/* Estimate from current, cooling power, surface and coolant temperature and the history. The model
 * must be valid and have these four inputs and its lags. in_domain is false until settled. */
kan_estimate_t history_estimate(const history_t *history, const kan_model_t *model,
                                const float *measured);

#ifdef __cplusplus
}
#endif

#endif
