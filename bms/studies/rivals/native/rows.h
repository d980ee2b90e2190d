/* Estimates by the thousand, for a host.
 *
 * Rows of inputs are profile after profile; profile p has the rows starts[p] to starts[p + 1] - 1.
 * One core temperature in K is written for each row.
 */
#ifndef ROWS_H
#define ROWS_H

#include "kalman.h"
#include "linear.h"
#include "mlp.h"
#include "quadratic.h"

void linear_rows(const linear_t *linear, const float *inputs, uint32_t rows, float *core_K);
void quadratic_rows(const quadratic_t *quadratic, const float *inputs, uint32_t rows,
                    float *core_K);
void mlp_rows(const mlp_t *mlp, const float *inputs, uint32_t rows, float *core_K);
void steady_kalman_rows(const steady_kalman_t *kalman, const float *inputs,
                        const uint32_t *starts, uint32_t profiles, float *core_K);
void kalman_rows(const kalman_t *kalman, const float *inputs, const uint32_t *starts,
                 uint32_t profiles, float *core_K);
void extended_kalman_rows(const kalman_t *kalman, const float *inputs, const uint32_t *starts,
                          uint32_t profiles, float *core_K);

#endif
