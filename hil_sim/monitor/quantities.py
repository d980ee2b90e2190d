"""The quantities of the cell with the limits that they have to keep."""

from __future__ import annotations

from dataclasses import dataclass

from bms.presets import Preset
from hil_sim.monitor import wording
from hil_sim.monitor.model import Reading, Snapshot


@dataclass(frozen=True)
class Range:
    """From an idle value to a limit, in the unit of the signal."""

    idle: float
    limit: float


@dataclass(frozen=True)
class Quantity:
    """A signal with its value and limit as text; the range is None while the preset is unknown."""

    label: str
    reading: Reading
    text: str
    limit_text: str
    range: Range | None
    bound: float = 0.0


@dataclass(frozen=True)
class _Kind:
    """How a quantity is written; its values are multiplied by `scale` first."""

    label: str
    signal: str
    digits: int
    unit: str
    scale: float = 1.0


_CORE = _Kind("core estimate", "CoreTemperature", 2, "K")
_SURFACE = _Kind("surface", "SurfaceTemperature", 2, "K")
_VOLTAGE = _Kind("voltage", "Voltage", 4, "V")
_SOC = _Kind("state of charge", "StateOfCharge", 2, "%", 100.0)
_CURRENT = _Kind("current", "Current", 3, "A")


def quantities(snapshot: Snapshot, preset: Preset | None) -> list[Quantity]:
    """Core estimate, surface, voltage, state of charge and current, in this order."""
    ranges = _ranges(preset) if preset else {}
    return [
        _quantity(kind, snapshot, ranges.get(kind))
        for kind in (_CORE, _SURFACE, _VOLTAGE, _SOC, _CURRENT)
    ]


def _ranges(preset: Preset) -> dict[_Kind, Range]:
    limits = preset.limits
    coldest_K = preset.operating_box.surface_temperature_K[0]
    return {
        _CORE: Range(coldest_K, limits.max_core_temperature_K),
        _SURFACE: Range(coldest_K, limits.max_surface_temperature_K),
        _VOLTAGE: Range(preset.cell.ocv.voltage_V[0], limits.max_voltage_V),
        _SOC: Range(0.0, limits.max_soc),
        _CURRENT: Range(0.0, limits.reference_current_A),
    }


def _quantity(kind: _Kind, snapshot: Snapshot, range_: Range | None) -> Quantity:
    reading = snapshot.readings[kind.signal]
    limit = Reading(range_.limit if range_ else None)
    is_core = kind is _CORE
    return Quantity(
        label=kind.label,
        reading=reading,
        text=wording.core_estimate(snapshot)
        if is_core
        else wording.quantity(reading, kind.digits, kind.unit, kind.scale),
        limit_text=wording.quantity(limit, kind.digits, kind.unit, kind.scale),
        range=range_,
        bound=(snapshot.readings["ErrorBound"].value or 0.0) if is_core else 0.0,
    )
