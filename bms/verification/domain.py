"""The states that a certificate speaks of, and how fast the cell can move within them.

A state lies in the domain when it is safe (B3, B4 and the surface chain psi not negative), inside
the preset's operating box, when no heat flow is larger there and when the condition in question
falls no faster than in states that can be reached from rest. The last two are bounds on weighted
sums of the heat flows; no history of current, cooling and disturbance from a cell at rest leaves
them (bms/barrier/rates.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from bms.barrier.rates import Weights, heat_range_W, largest_rate
from bms.cell import CellParameters
from bms.errors import InputError
from bms.presets import Preset
from bms.verification.conditions import Chain, Condition
from bms.verification.intervals import Interval


class Point(NamedTuple):
    """Coordinates of boxes: temperatures in differences, current, cooling power."""

    surface_K: Any
    core_gap_K: Any
    coolant_gap_K: Any
    current_A: Any
    cooling_W: Any


class Rates(NamedTuple):
    """Rates of core, surface and coolant temperature in K/s."""

    core: Any
    surface: Any
    coolant: Any


@dataclass(frozen=True)
class FlowLimit:
    """core (Tc - Ts) + coolant (Ts - Tinf) + inputs <= largest: rate of a sum of temperatures."""

    core: float
    coolant: float
    inputs: float
    largest: float

    def rate(self, core_gap: Any, coolant_gap: Any) -> Any:
        """Largest rate at these temperature differences over all inputs; floats or intervals."""
        return self.core * core_gap + self.coolant * coolant_gap + self.inputs


@dataclass(frozen=True)
class Domain:
    """Cell, limits and ranges of a certificate.

    The flow limits are, in this order, the fall of the condition, Tc - Ts from above and below, and
    Ts - Tinf from below and above.
    """

    cell: CellParameters
    preset: Preset
    chain: Chain
    flows: tuple[FlowLimit, ...]
    low: Point
    high: Point
    heat_W: Interval

    @property
    def held_s(self) -> float:
        """Longest time from a reading to the end of the current that follows from it."""
        return self.preset.timing.sampling_period_s + self.preset.timing.delay_s

    @property
    def core_gap_K(self) -> tuple[float, float]:
        """Range of Tc - Ts in K within the domain."""
        highest, lowest = self.flows[1], self.flows[2]
        return (
            (lowest.largest - lowest.inputs) / lowest.core,
            (highest.largest - highest.inputs) / highest.core,
        )

    @property
    def coolant_gap_K(self) -> tuple[float, float]:
        """Range of Ts - Tinf in K within the domain."""
        lowest, highest = self.flows[3], self.flows[4]
        return (
            (lowest.largest - lowest.inputs) / lowest.coolant,
            (highest.largest - highest.inputs) / highest.coolant,
        )

    def rates(self, core_gap: Any, coolant_gap: Any, cooling_W: Any) -> Rates:
        """Enclosure of the rates over every heat and disturbance, for intervals."""
        cell, bounds = self.cell, self.preset.uncertainty
        core_W = core_gap * (1.0 / cell.core_resistance_K_per_W)
        surface_W = coolant_gap * (1.0 / cell.surface_resistance_K_per_W)
        return Rates(
            ((self.heat_W - core_W) * (1.0 / cell.core_heat_capacity_J_per_K)).widened(
                bounds.core_K_per_s
            ),
            ((core_W - surface_W) * (1.0 / cell.surface_heat_capacity_J_per_K)).widened(
                bounds.surface_K_per_s
            ),
            ((surface_W - cooling_W) * (1.0 / cell.coolant_heat_capacity_J_per_K)).widened(
                bounds.coolant_K_per_s
            ),
        )

    def surface_rate(self, core_gap: Any, coolant_gap: Any) -> Any:
        """Undisturbed rate of the surface temperature in K/s; floats, arrays or intervals."""
        cell = self.cell
        capacity = cell.surface_heat_capacity_J_per_K
        return core_gap * (1.0 / (cell.core_resistance_K_per_W * capacity)) - coolant_gap * (
            1.0 / (cell.surface_resistance_K_per_W * capacity)
        )

    def chain_value(self, surface_K: Any, core_gap: Any, coolant_gap: Any) -> Any:
        """psi in K/s at the surface disturbance that is best for it: negative means unsafe."""
        room_K = self.preset.limits.max_surface_temperature_K - surface_K
        return (
            self.chain.first_per_s * room_K
            - self.surface_rate(core_gap, coolant_gap)
            + self.preset.uncertainty.surface_K_per_s
        )

    @property
    def chain_reserve_K_per_s(self) -> float:
        """By how much a chain that has the worst disturbance in it is less than chain_value.

        0 for the paper's, which contains the disturbance that acts.
        """
        is_worst_case = self.preset.gains.surface_condition == "worst-case"
        return 2.0 * self.preset.uncertainty.surface_K_per_s if is_worst_case else 0.0


def certified_domain(preset: Preset, condition: Condition, surface_chain: Chain) -> Domain:
    """Domain of a preset for the condition that has to hold in it.

    Raises InputError when the operating box lies above a limit.
    """
    box, limits = preset.operating_box, preset.limits
    surface_low, surface_high = box.surface_temperature_K
    surface_high = min(surface_high, limits.max_surface_temperature_K)
    for limit in ("max_core_temperature_K", "max_surface_temperature_K"):
        if getattr(limits, limit) <= surface_low:
            raise InputError(
                f"preset '{preset.name}': operating_box.surface_temperature_K begins at "
                f"{surface_low:g}, where limits.{limit} is {getattr(limits, limit):g}: no state is "
                "left to certify; lower the begin of the box or raise the limit"
            )
    coolant_low, coolant_high = box.coolant_temperature_K
    heat = heat_range_W(preset.cell, preset)
    return Domain(
        cell=preset.cell,
        preset=preset,
        chain=surface_chain,
        flows=tuple(
            _flow_limit(preset, combination)
            for combination in (
                Weights(*(-weight for weight in weights(condition))),
                *(Weights(sign, 0.0, 0.0) for sign in (-1.0, 1.0)),
                *(Weights(0.0, 0.0, sign) for sign in (-1.0, 1.0)),
            )
        ),
        low=Point(
            surface_low,
            surface_low - surface_high,
            surface_low - coolant_high,
            limits.reference_current_A,
            box.cooling_power_W[0],
        ),
        high=Point(
            surface_high,
            limits.max_core_temperature_K - surface_low,
            surface_high - coolant_low,
            0.0,
            box.cooling_power_W[1],
        ),
        heat_W=Interval(np.float64(heat.low), np.float64(heat.high)),
    )


def weights(condition: Condition) -> Weights:
    """Slope of a condition over core, surface and coolant temperature at held current."""
    return Weights(
        condition.core_gap,
        -condition.core_gap - condition.coolant_gap - condition.room,
        condition.coolant_gap,
    )


def _flow_limit(preset: Preset, combination: Weights) -> FlowLimit:
    """Bound on the rate of a weighted sum of temperatures, as one on temperature differences."""
    cell, bounds = preset.cell, preset.uncertainty
    core, surface, coolant = combination
    cc, cs = cell.core_heat_capacity_J_per_K, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    heat, cooling_W = heat_range_W(cell, preset), preset.operating_box.cooling_power_W
    return FlowLimit(
        core=(surface / cs - core / cc) / cell.core_resistance_K_per_W,
        coolant=(coolant / cinf - surface / cs) / cell.surface_resistance_K_per_W,
        inputs=float(
            max(core * heat.low, core * heat.high) / cc
            + max(-coolant * cooling_W[0], -coolant * cooling_W[1]) / cinf
            + abs(core) * bounds.core_K_per_s
            + abs(surface) * bounds.surface_K_per_s
            + abs(coolant) * bounds.coolant_K_per_s
        ),
        largest=float(largest_rate(cell, preset, combination)),
    )
