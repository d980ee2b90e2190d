"""The rate that a cell's heat balance lacks where only its surface was measured."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.identification.disturbance import missing_rate
from bms.identification.surface_thermal import ThermalFit, ThermalRecord, temperatures_K

ACCURACY_K = 0.1


def lumped_missing_K_per_s(
    fit: ThermalFit, record: ThermalRecord, heat_W: Array, accuracy_K: float = ACCURACY_K
) -> Array:
    """Rate (N,) with which the whole cell follows the measured surface within `accuracy_K`.

    The core is taken to follow the surface: what is missing between measured and modelled surface
    obeys dr/dt = -r/(Rs C) + rate. The smoothest such rate, as of a measured core.
    """
    _, surface_K = temperatures_K(fit, record, heat_W)
    open_K = record.surface_K - surface_K
    total_J_per_K = fit.core_heat_capacity_J_per_K + fit.surface_heat_capacity_J_per_K
    known = -open_K[:-1] / (fit.surface_resistance_K_per_W * total_J_per_K)
    return np.asarray(missing_rate(record.time_s, open_K, known, accuracy_K).rate_K_per_s)
