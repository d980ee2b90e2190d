"""The part of the calibration block that the planner predicts a charge with."""

from __future__ import annotations

from typing import Any

import numpy as np

from bms.presets import Preset

STEP_S = 5.0
"""Step of a prediction: exact for what is held in it, and a small part of any charge."""


def planner_fields(preset: Preset) -> dict[str, Any]:
    """Content of planner_constants_t: a step of the nominal cell's masses and their coolant.

    Exact discretisation with heat (W, into the core) and cooling power (W, out of the coolant)
    held; temperatures above any fixed one.
    """
    # Imported here, so that an ECU with the compiled-in constants starts without SciPy.
    from scipy.linalg import expm  # noqa: PLC0415

    cell, period_s = preset.cell, preset.timing.sampling_period_s
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    rates = np.zeros((5, 5))
    rates[0] = [-1.0 / (rc * cc), 1.0 / (rc * cc), 0.0, 1.0 / cc, 0.0]
    rates[1] = [1.0 / (rc * cs), -1.0 / (rc * cs) - 1.0 / (rs * cs), 1.0 / (rs * cs), 0.0, 0.0]
    rates[2] = [0.0, 1.0 / (rs * cinf), -1.0 / (rs * cinf), 0.0, -1.0 / cinf]
    discrete = expm(rates * STEP_S)
    return {
        "period_s": period_s,
        "step_s": STEP_S,
        "growth_A": preset.limits.current_growth_A_per_s * STEP_S,
        "completion_soc": preset.limits.completion_soc,
        # Without the last digits, which depend on a machine's linear algebra.
        "response": [float(f"{value:.7g}") for value in discrete[:3].ravel()],
    }
