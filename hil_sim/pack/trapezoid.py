"""Allowed charging current as foxBMS has it: the least of trapezoids over readings.

Between a cut-off and a limit the current falls linearly to 0 A. foxBMS 2 (v1.6.0,
`src/app/application/algorithm/state_estimation/sof/trapezoid/`) goes by the extreme cell voltages
and temperatures, foxBMS 1 (`mcu-primary/src/application/config/sox_cfg.h`) by the state of charge
as well. Distances between cut-off and limit are those of their shipped configurations; the limits
are the cell's.
"""

from __future__ import annotations

from dataclasses import dataclass

from bms.presets import Preset

VOLTAGE_BELOW_V, VOLTAGE_WIDTH_V = 0.050, 0.030
"""The voltage limit is the recommended one, so far below the maximum safety limit."""
TEMPERATURE_WIDTH_K = 10.0
COLD_LIMIT_K, COLD_CUTOFF_K = 253.15, 263.15
SOC_CUTOFF, SOC_LIMIT = 0.85, 0.95


@dataclass(frozen=True)
class Readings:
    """Extremes over all cells."""

    highest_voltage_V: float
    hottest_K: float
    coldest_K: float
    highest_soc: float


@dataclass(frozen=True)
class Trapezoid:
    """Breakpoints for the cell of a preset."""

    preset: Preset
    by_soc: bool = False
    """As in foxBMS 1 too."""

    def allowed_A(self, readings: Readings) -> float:
        """Charging current, 0 A or negative."""
        limits = self.preset.limits
        limit_V = limits.max_voltage_V - VOLTAGE_BELOW_V
        hot_K = min(limits.max_surface_temperature_K, limits.max_core_temperature_K)
        shares = [
            _falling(readings.highest_voltage_V, limit_V - VOLTAGE_WIDTH_V, limit_V),
            _falling(readings.hottest_K, hot_K - TEMPERATURE_WIDTH_K, hot_K),
            _falling(-readings.coldest_K, -COLD_CUTOFF_K, -COLD_LIMIT_K),
        ]
        if self.by_soc:
            shares.append(_falling(readings.highest_soc, SOC_CUTOFF, SOC_LIMIT))
        return limits.reference_current_A * min(shares)


def _falling(value: float, cutoff: float, limit: float) -> float:
    """1 up to the cut-off, 0 from the limit on, and for what is no number."""
    if value <= cutoff:
        return 1.0
    return (limit - value) / (limit - cutoff) if value < limit else 0.0
