"""Constants by which the firmware keeps the limits on every cell of a preset's family.

Each is the worst end of the preset's intervals; docs/family.md derives what the firmware does with
them, and bms/verification/family.py checks that from the model, not from here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bms.arrays import Array
from bms.barrier.rates import Interval, Weights, largest_rate
from bms.barrier.readings import reading_errors
from bms.bus_signals import BUS, BusQuantisation
from bms.cell import CellInterval, CellParameters
from bms.errors import InputError
from bms.presets.schema import Preset

SOC_CELLS = 32
TEMPERATURES = 12
SHORTEST_REST_S = 2.0
"""Time at rest, at least, after which the surface has told the core temperature."""
_TOLD_WITHIN_K = 2.0
"""By how much two readings of the surface, at the ends of that time, may mistell the core."""
CHARGE_WINDOW_S = 10.0
"""Time in a charge over which the surface tells how hot the core is at least."""
FULL_PERIODS = 10
INNER_K = 0.02
"""By which the core is kept below its limit beyond what is derived: float32, and starts that are
not at rest."""
_UNIT = 1e-5
"""Share by which constants are moved to the safe side, far above the rounding of float32."""
_SAMPLES = 200


@dataclass(frozen=True)
class Extremes:
    """Ends of the family's parameters, in units of the nominal ones' names."""

    core_resistance: tuple[float, float]
    core_heat_capacity: tuple[float, float]
    surface_resistance: tuple[float, float]
    surface_heat_capacity: tuple[float, float]
    capacity_As: tuple[float, float]


def family_of(preset: Preset) -> CellInterval:
    """The preset's family; raises InputError where it has none."""
    if preset.cell.interval is None:
        raise InputError(
            f"preset '{preset.name}': cell.interval is missing; give the family of cells that it "
            "speaks for (docs/presets.md)"
        )
    return preset.cell.interval


def extremes(cell: CellParameters, interval: CellInterval) -> Extremes:
    """Ends of the parameters that only occur as products with a factor."""

    def ends(nominal: float, factors: tuple[float, float]) -> tuple[float, float]:
        return nominal * factors[0], nominal * factors[1]

    return Extremes(
        ends(cell.core_resistance_K_per_W, interval.core_resistance),
        ends(cell.core_heat_capacity_J_per_K, interval.core_heat_capacity),
        ends(cell.surface_resistance_K_per_W, interval.surface_resistance),
        ends(cell.surface_heat_capacity_J_per_K, interval.surface_heat_capacity),
        ends(cell.capacity_As, interval.capacity),
    )


def corner_cells(cell: CellParameters, interval: CellInterval) -> Iterator[CellParameters]:
    """Cells at the corners of the thermal intervals."""
    names = (
        "core_resistance",
        "core_heat_capacity",
        "surface_resistance",
        "surface_heat_capacity",
        "coolant_heat_capacity",
    )
    units = ("K_per_W", "J_per_K", "K_per_W", "J_per_K", "J_per_K")
    for factors in itertools.product(*(getattr(interval, name) for name in names)):
        changes = {
            f"{name}_{unit}": getattr(cell, f"{name}_{unit}") * factor
            for name, unit, factor in zip(names, units, factors)
        }
        yield replace(cell, **changes)


def ohmic_ohm(cell: CellParameters, temperature_K: Array) -> tuple[Array, Array]:
    """Least and greatest nominal resistance at temperatures (K), over all states of charge."""
    if cell.resistance is None:
        constant = np.full_like(temperature_K, cell.ohmic_resistance_ohm)
        return constant, constant
    ohm = cell.resistance(temperature_K[:, None], np.asarray(cell.resistance.soc)[None, :])
    return ohm.min(axis=1), ohm.max(axis=1)


def temperatures_K(cell: CellParameters, low_K: float, high_K: float) -> Array:
    """Temperatures of a range, close together and with every point of the cell's table in it."""
    points = () if cell.resistance is None else cell.resistance.temperature_K
    kinks = [point for point in points if low_K < point < high_K]
    return np.union1d(np.linspace(low_K, high_K, 10 * _SAMPLES), kinks)


def warmest_resistance_ohm(preset: Preset, grid_K: Array) -> Array:
    """Greatest resistance of the family at each temperature of a grid and all warmer ones.

    What is linear between the values is nowhere below the resistance.
    """
    interval = family_of(preset)
    fine_K = np.union1d(temperatures_K(preset.cell, grid_K[0], grid_K[-1]), grid_K)
    _, greatest = ohmic_ohm(preset.cell, fine_K)
    envelope = np.maximum.accumulate(greatest[::-1])[::-1] * interval.resistance[1]
    nodes = np.interp(grid_K, fine_K, envelope)
    missing = np.maximum(envelope - np.interp(fine_K, grid_K, nodes), 0.0)
    cells = np.clip(np.searchsorted(grid_K, fine_K, side="right") - 1, 0, len(grid_K) - 2)
    for cell in range(len(grid_K) - 1):
        lacking = float(missing[cells == cell].max(initial=0.0))
        nodes[cell] += lacking
        nodes[cell + 1] += lacking
    return np.asarray(np.maximum.accumulate(nodes[::-1])[::-1])


def by_soc_cell(points: tuple[float, ...], values: Array, per_segment: bool) -> Array:
    """Greatest value within each cell of the grid, of a table linear between points (or constant
    on its segments)."""
    edges = np.linspace(0.0, 1.0, SOC_CELLS + 1)
    greatest = []
    for low, high in itertools.pairwise(edges):
        if per_segment:
            touched = [
                value
                for (left, right), value in zip(itertools.pairwise(points), values)
                if left <= high and right >= low
            ]
        else:
            inside = [value for point, value in zip(points, values) if low <= point <= high]
            touched = [*inside, *np.interp([low, high], points, values)]
        greatest.append(max(touched))
    return np.array(greatest)


def ocv_slopes_V(cell: CellParameters) -> Array:
    """Greatest slope of the open-circuit voltage in each cell of the grid, in V."""
    slopes = np.diff(cell.ocv.voltage_V) / np.diff(cell.ocv.soc)
    greatest = by_soc_cell(cell.ocv.soc, slopes, per_segment=True)
    greatest[-1] = max(greatest[-1], cell.ocv.overfill_slope_V)
    return greatest


def entropic_V_per_K(cell: CellParameters, interval: CellInterval) -> Array:
    """Greatest dU/dT of the family in each cell of the grid."""
    if cell.entropy is None:
        greatest = np.full(SOC_CELLS, cell.entropic_coefficient_V_per_K)
    else:
        values = np.asarray(cell.entropy.V_per_K)
        greatest = by_soc_cell(cell.entropy.soc, values, per_segment=False)
    return np.asarray(greatest + interval.entropic_error_V_per_K)


def polarisation_ohm(cell: CellParameters, interval: CellInterval) -> float:
    """Greatest sum of the branches' resistances."""
    return interval.polarisation[1] * sum(branch.resistance_ohm for branch in cell.branches)


def time_constant_factor(cell: CellParameters, interval: CellInterval) -> float:
    """By which the time constant of each branch may be off, either way."""
    if not cell.branches:
        return 1.0
    longest_s = max(branch.time_constant_s for branch in cell.branches)
    return max(1.0, interval.longest_relaxation_s / longest_s)


def strengths_A(preset: Preset, temperature_K: Array, soc: Array) -> Array:
    """Strongest current of the preset over temperatures and states of charge (n, m), in A."""
    strongest_A = -preset.limits.reference_current_A * (1.0 + preset.supply.tolerance)
    if preset.current_map is None:
        return np.full((len(temperature_K), len(soc)), strongest_A)
    table = preset.current_map
    rows = np.array([np.interp(soc, table.soc, row) for row in table.largest_A])
    mapped = np.array(
        [np.interp(temperature_K, table.temperature_K, column) for column in rows.T]
    ).T
    return np.asarray(np.minimum(mapped, strongest_A))


def greatest_heat_W(preset: Preset) -> float:
    """Most heat in a core of the family at a current that the preset allows, in W.

    The overpotential is no more than resistance and branches make of the current, nor than the
    voltage limit leaves above the open-circuit voltage.
    """
    cell, interval, limits = preset.cell, family_of(preset), preset.limits
    box = preset.operating_box.surface_temperature_K
    temperature_K = np.linspace(box[0], limits.max_core_temperature_K, _SAMPLES)
    soc = np.linspace(0.0, 1.0, SOC_CELLS * 8 + 1)
    strength_A = strengths_A(preset, temperature_K, soc)
    ohm = warmest_resistance_ohm(preset, temperature_K) + polarisation_ohm(cell, interval)
    room_V = limits.max_voltage_V - cell.ocv(soc) + interval.ocv_error_V
    entropic = (
        np.interp(soc, cell.entropy.soc, cell.entropy.V_per_K)
        if cell.entropy is not None
        else np.full_like(soc, cell.entropic_coefficient_V_per_K)
    )
    reversible_V = (entropic + interval.entropic_error_V_per_K) * limits.max_core_temperature_K
    overpotential_V = np.minimum(ohm[:, None] * strength_A, room_V[None, :])
    return float(np.max(strength_A * (overpotential_V + reversible_V[None, :])))


def surface_rise_K_per_s(preset: Preset) -> float:
    """Fastest rise of a surface of the family in every history from rest, in K/s."""
    cell, interval = preset.cell, family_of(preset)
    heat_W = Interval(low=0.0, high=greatest_heat_W(preset))
    surface = Weights(0.0, 1.0, 0.0)
    return max(
        float(largest_rate(corner, preset, surface, heat_W))
        for corner in corner_cells(cell, interval)
    )


def rest_s(preset: Preset) -> float:
    """Time at rest in s after which the surface tells the core; long where the surface is slow.

    The core is above the surface by Rc Cs times the slope of the surface, which two readings tell
    the better the further they are apart.
    """
    ends = extremes(preset.cell, family_of(preset))
    slowness_s = ends.core_resistance[1] * ends.surface_heat_capacity[1]
    error_K = reading_errors(preset).surface_K
    return max(SHORTEST_REST_S, 2.0 * slowness_s * error_K / _TOLD_WITHIN_K)


def hold_s(preset: Preset) -> float:
    """Longest mean time from a reading to the current that follows from it, and its own hold."""
    timing = preset.timing
    return timing.sampling_period_s + timing.delay_s + preset.supply.lag_s


def inner_K(preset: Preset) -> float:
    """By how much the core is kept below its limit, so that the surface keeps its own.

    A surface between core and coolant exceeds both by no more than its disturbance makes of the
    least of its two conductances over its heat capacity.
    """
    ends = extremes(preset.cell, family_of(preset))
    capacity = ends.surface_heat_capacity[1]
    per_s = 1.0 / (ends.core_resistance[1] * capacity) + 1.0 / (
        ends.surface_resistance[1] * capacity
    )
    limits = preset.limits
    above_K = max(0.0, limits.max_core_temperature_K - limits.max_surface_temperature_K)
    return INNER_K + above_K + preset.uncertainty.surface_K_per_s / per_s


def voltage_error_V(preset: Preset, bus: BusQuantisation = BUS) -> float:
    """Largest error of a voltage reading."""
    return preset.sensors.voltage_V.error_bound + bus.voltage_V


def current_error_A(preset: Preset, bus: BusQuantisation = BUS) -> float:
    """Largest error of a current reading."""
    return preset.sensors.current_A.error_bound + bus.current_A


def exponential_share(period_s: float, time_s: float) -> float:
    """Share of its way that a first-order lag goes in a period; 1 without lag."""
    return 1.0 if time_s == 0.0 else 1.0 - math.exp(-period_s / time_s)
