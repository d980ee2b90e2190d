#include "cell.h"

#include <stdbool.h>
#include <stddef.h>

/* Index of the point below, so that one above exists; needs two points and a value on the axis. */
static uint32_t point_below(const double *axis, uint32_t points, double at)
{
    uint32_t low = 0u;
    uint32_t high = points - 1u;
    while (high - low > 1u) {
        const uint32_t middle = (low + high) / 2u;
        if (at >= axis[middle]) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* As numpy.interp. */
static double curve_at(const cell_curve_t *curve, double at)
{
    const uint32_t last = curve->points - 1u;
    if (at <= curve->axis[0]) {
        return curve->value[0];
    }
    if (at >= curve->axis[last]) {
        return curve->value[last];
    }
    const uint32_t i = point_below(curve->axis, curve->points, at);
    const double slope =
        (curve->value[i + 1u] - curve->value[i]) / (curve->axis[i + 1u] - curve->axis[i]);
    return slope * (at - curve->axis[i]) + curve->value[i];
}

typedef struct {
    uint32_t below;
    uint32_t above;
    double share;
} position_t;

static position_t position_of(const double *axis, uint32_t points, double at)
{
    const uint32_t last = points - 1u;
    if ((last == 0u) || (at <= axis[0])) {
        return (position_t){ 0u, 0u, 0.0 };
    }
    if (at >= axis[last]) {
        return (position_t){ last, last, 0.0 };
    }
    const uint32_t i = point_below(axis, points, at);
    return (position_t){ i, i + 1u, (at - axis[i]) / (axis[i + 1u] - axis[i]) };
}

static double resistance_ohm(const cell_t *cell, double core_K, double soc)
{
    const cell_resistance_t *table = &cell->resistance;
    if (table->rows == 0u) {
        return cell->ohmic_resistance_ohm;
    }
    const position_t s = position_of(table->soc, table->columns, soc);
    const position_t t = position_of(table->temperature_K, table->rows, core_K);
    const double *colder = &table->ohm[t.below * table->columns];
    const double *warmer = &table->ohm[t.above * table->columns];
    const double cold = colder[s.below] * (1.0 - s.share) + colder[s.above] * s.share;
    const double warm = warmer[s.below] * (1.0 - s.share) + warmer[s.above] * s.share;
    return cold * (1.0 - t.share) + warm * t.share;
}

static double entropic_V_per_K(const cell_t *cell, double soc)
{
    return (cell->entropy_V_per_K.points == 0u) ? cell->entropic_coefficient_V_per_K
                                                : curve_at(&cell->entropy_V_per_K, soc);
}

static double heat_W(const cell_t *cell, double core_K, double soc, double current_A)
{
    return (resistance_ohm(cell, core_K, soc) * current_A - entropic_V_per_K(cell, soc) * core_K) *
           current_A;
}

double cell_heat_W(const cell_t *cell, const cell_state_t *state, double current_A)
{
    return heat_W(cell, state->core, state->soc, current_A);
}

double cell_polarisation_heat_W(const cell_t *cell, const double *polarisation_V)
{
    double sum_W = 0.0;
    for (uint32_t i = 0u; i < cell->branches; i++) {
        sum_W += polarisation_V[i] * polarisation_V[i] / cell->branch[i].resistance_ohm;
    }
    return sum_W;
}

/* Moves the branches on and returns their mean heat over the step, by Simpson's rule on voltages
 * that are exact. */
static double advance_branches(const cell_t *cell, double *polarisation_V, double current_A)
{
    double mean_W = 0.0;
    for (uint32_t i = 0u; i < cell->branches; i++) {
        const cell_branch_t *branch = &cell->branch[i];
        const double steady_V = -current_A * branch->resistance_ohm;
        const double begin_V = polarisation_V[i];
        const double middle_V = steady_V + (begin_V - steady_V) * branch->left_at_middle;
        const double end_V = steady_V + (begin_V - steady_V) * branch->left_at_end;
        mean_W += (begin_V * begin_V + 4.0 * middle_V * middle_V + end_V * end_V) /
                  (6.0 * branch->resistance_ohm);
        polarisation_V[i] = end_V;
    }
    return mean_W;
}

void cell_step(const cell_t *cell, cell_memory_t *memory, double current_A, double cooling_power_W,
               const cell_state_t *before, const cell_state_t *after)
{
    const cell_thermal_step_t *map = &cell->thermal;
    cell_state_t *state = &memory->state;
    const double soc_change =
        cell->step_s * (0.5 * (before->soc + after->soc) - current_A / cell->capacity_As);
    const double middle_K = state->core + 0.5 * memory->core_change_K;
    const double core_W = heat_W(cell, middle_K, state->soc + 0.5 * soc_change, current_A) +
                          advance_branches(cell, memory->polarisation_V, current_A);
    const double core_gap_K = state->core - state->surface;
    const double coolant_gap_K = state->coolant - state->surface;
    double change_K[3];
    for (uint32_t i = 0u; i < 3u; i++) {
        const double *b = map->before_s[i];
        const double *a = map->after_s[i];
        change_K[i] = (map->core_gap[i] * core_gap_K + map->coolant_gap[i] * coolant_gap_K) +
                      (map->heat_K_per_W[i] * core_W - map->cooling_K_per_W[i] * cooling_power_W) +
                      (b[0] * before->core + b[1] * before->surface + b[2] * before->coolant) +
                      (a[0] * after->core + a[1] * after->surface + a[2] * after->coolant);
    }
    state->soc += soc_change;
    state->core += change_K[0];
    state->surface += change_K[1];
    state->coolant += change_K[2];
    memory->core_change_K = change_K[0];
}

double cell_open_circuit_voltage_V(const cell_t *cell, double soc)
{
    const double within_V = curve_at(&cell->ocv_V, soc);
    return (soc > 1.0) ? within_V + cell->overfill_slope_V * (soc - 1.0) : within_V;
}

double cell_terminal_voltage_V(const cell_t *cell, const cell_memory_t *memory, double current_A)
{
    const cell_state_t *state = &memory->state;
    double voltage_V = cell_open_circuit_voltage_V(cell, state->soc) -
                       current_A * resistance_ohm(cell, state->core, state->soc);
    for (uint32_t i = 0u; i < cell->branches; i++) {
        voltage_V += memory->polarisation_V[i];
    }
    return voltage_V;
}

static double larger(double a, double b)
{
    return (a > b) ? a : b;
}

static void note_voltage(const cell_t *cell, const cell_memory_t *memory, double current_A,
                         cell_peaks_t *peaks)
{
    peaks->voltage_V =
        larger(peaks->voltage_V, cell_terminal_voltage_V(cell, memory, current_A));
}

void cell_hold(const cell_t *cell, cell_memory_t *memory, double current_A, double cooling_power_W,
               double growth, cell_state_t *knot, const double *knots, uint32_t steps,
               cell_peaks_t *peaks, cell_watch_t watch, void *watcher)
{
    const bool is_plain = (cell->branches == 0u) && (cell->resistance.rows == 0u);
    cell_memory_t fullest = *memory;
    if (!is_plain) {
        note_voltage(cell, memory, current_A, peaks);
    }
    cell_state_t before = *knot;
    before.core *= growth;
    for (uint32_t i = 0u; i < steps; i++) {
        const double *end = &knots[i * CELL_KNOT_WIDTH];
        const cell_state_t after = { end[0], end[1] * growth, end[2], end[3] };
        if (watch != NULL) {
            watch(watcher, &before);
        }
        cell_step(cell, memory, current_A, cooling_power_W, &before, &after);
        before = after;
        fullest.state.soc = larger(fullest.state.soc, memory->state.soc);
        peaks->core_temperature_K = larger(peaks->core_temperature_K, memory->state.core);
        peaks->surface_temperature_K = larger(peaks->surface_temperature_K, memory->state.surface);
        if (!is_plain) {
            note_voltage(cell, memory, current_A, peaks);
        }
    }
    const double *last = &knots[(steps - 1u) * CELL_KNOT_WIDTH];
    *knot = (cell_state_t){ last[0], last[1], last[2], last[3] };
    peaks->soc = larger(peaks->soc, fullest.state.soc);
    if (is_plain) {
        /* At one current the voltage rises with the state of charge, so its peak is there. */
        note_voltage(cell, &fullest, current_A, peaks);
    }
}
