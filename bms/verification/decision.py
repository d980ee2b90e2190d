"""The decision by given constants, in float64 and for arrays of states; corrected or with slips."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bms.cell import CellState
from bms.verification.conditions import decided_conditions


def decide(
    constants: Mapping[str, Any],
    reading: CellState,
    cooling_W: Any,
    reference_A: Any,
) -> tuple[Any, Any, Any]:
    """Lower and upper end of the admitted currents (A), and what sets the lower end by name.

    The reading carries counted state of charge, estimated core and measured other temperatures.
    The interval is empty, lower above upper, where no current is safe.
    """
    k = constants
    counted, core_K, surface_K, coolant_K = reading
    soc = counted + k["soc_error"]
    voltage_A = (
        -(k["max_voltage_V"] - k["ocv"](soc) - k["voltage_margin_V"]) / k["ohmic_resistance_ohm"]
    )
    soc_A = -k["capacity_As"] * (
        k["alpha1_per_s"] * (k["max_soc"] - soc)
        - k["soc_uncertainty_per_s"]
        - k["soc_margin_per_s"]
    )
    lowest = [("none", reference_A), ("voltage", voltage_A), ("soc", soc_A)]
    upper_A: Any = 0.0
    for name, condition in zip(("core", "surface"), decided_conditions(constants)):
        rest = condition.value(core_K, surface_K, coolant_K, 0.0, cooling_W)
        for constant, per_A in condition.branches():
            slope = condition.coupling * core_K + per_A
            discriminant = slope * slope - 4.0 * condition.squared * (rest + constant)
            root = np.sqrt(np.maximum(discriminant, 0.0))
            # squared < 0: the greater numerator gives the lower end.
            low_A = np.where(discriminant < 0.0, np.inf, (-slope + root) / (2 * condition.squared))
            high_A = np.where(
                discriminant < 0.0, -np.inf, (-slope - root) / (2 * condition.squared)
            )
            lowest.append((name, low_A))
            upper_A = np.minimum(upper_A, high_A)
    ends = np.stack(np.broadcast_arrays(*(end for _, end in lowest)))
    lower_A, first = np.max(ends, axis=0), np.argmax(ends, axis=0)
    names = np.array([name for name, _ in lowest])
    return lower_A, upper_A, np.where(lower_A <= upper_A, names[first], "infeasible")
