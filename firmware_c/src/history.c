#include "history.h"

#include "numeric.h"

void history_reset(history_t *history)
{
    *history = (history_t){ .current_A = 0.0f };
}

void history_step(history_t *history, const kan_model_t *model, float current_A,
                  float surface_temperature_K, bool is_usable)
{
    const bool is_good = is_usable && numeric_is_finite(current_A) &&
                         numeric_is_finite(surface_temperature_K);
    const uint32_t bridged = is_good ? 0u : (history->bridged + 1u);
    if ((bridged > HISTORY_MAX_BRIDGED) || ((bridged > 0u) && (history->periods == 0u))) {
        history_reset(history);
        history->bridged = HISTORY_MAX_BRIDGED + 1u;
        return;
    }
    history->bridged = bridged;
    const float current_now_A = is_good ? current_A : history->current_A;
    const float surface_now_K = is_good ? surface_temperature_K : history->surface_temperature_K;
    const float change_K =
        (history->periods > 0u) ? (surface_now_K - history->surface_temperature_K) : 0.0f;
    for (uint32_t i = 0u; i < model->lags; i++) {
        const kan_lag_t *lag = &model->lag[i];
        const float drive = (lag->quantity == KAN_SURFACE_TEMPERATURE_RISE)
                                ? change_K
                                : (current_now_A * current_now_A);
        history->filtered[i] = lag->decay * history->filtered[i] + lag->gain * drive;
    }
    history->current_A = current_now_A;
    history->surface_temperature_K = surface_now_K;
    if (history->periods < UINT32_MAX) {
        history->periods++;
    }
}

bool history_is_settling(const history_t *history, const kan_model_t *model)
{
    return (history->bridged <= HISTORY_MAX_BRIDGED) &&
           (history->periods < model->settling_periods);
}

kan_estimate_t history_estimate(const history_t *history, const kan_model_t *model,
                                const float *measured)
{
    float inputs[KAN_MAX_WIDTH];
    for (uint32_t i = 0u; i < KAN_MEASURED_INPUTS; i++) {
        inputs[i] = measured[i];
    }
    for (uint32_t i = 0u; i < model->lags; i++) {
        inputs[KAN_MEASURED_INPUTS + i] = history->filtered[i];
    }
    kan_estimate_t estimate = kan_evaluate(model, inputs);
    estimate.in_domain = estimate.in_domain && (history->periods >= model->settling_periods);
    return estimate;
}
