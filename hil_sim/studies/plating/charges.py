"""Charges of an electrochemical model at one temperature, watched at the anode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.optimize import brentq

from bms.arrays import Array
from bms.errors import PlantError
from hil_sim.plant.electrochemistry import Outputs

SOC_STEP = 0.02
_CURRENT_TOLERANCE_A = 0.005
FULL = 0.99
"""End of a charge; beyond, the model of the positive electrode has little to say."""
_NO_SOLUTION_V = -1.0
_NEAR = 1e-4
_GROWTH = 1.2
"""At most, from step to step: what a current far too strong does to a full cell is not solved."""
_LEAST_A = 0.02
"""A weaker current charges no cell in a day."""


class Anode(Protocol):
    """An electrochemical cell as `hil_sim.plant.electrochemistry` has it."""

    capacity_As: float

    def step(
        self, current_A: float, temperature_K: float, step_s: float | None = None
    ) -> tuple[Outputs, Outputs]:
        """Begin and end of a step."""
        ...

    def keep(self) -> None:
        """Take the end of the last step as the present state."""
        ...

    def restart(self) -> None:
        """Take the rest at the beginning as the present state."""
        ...


def strongest_currents(
    cell: Anode, temperature_K: float, margin_V: float, most_A: float
) -> tuple[Array, Array]:
    """State of charge and current (A), both (N,), of the fastest charge without plating.

    From rest at the cell's beginning on each step takes the strongest current, at most `most_A`, at
    whose end the anode potential is `margin_V` or more. So each value holds after the strongest
    currents before it, which leave the steepest gradients. The last one is 0 A where the charge
    comes to its end before it is full.
    """
    cell.restart()
    soc, strength_A = 0.0, most_A
    charges, strengths_A = [], []
    while soc < FULL - _NEAR:
        step_s = min(SOC_STEP, FULL - soc) * cell.capacity_As / strength_A

        def room_V(strength_A: float, step_s: float = step_s) -> float:
            try:
                _, end = cell.step(-strength_A, temperature_K, step_s)
            except PlantError:
                if strength_A == 0.0:
                    raise
                return _NO_SOLUTION_V
            return end.anode_potential_V - margin_V

        stronger_A = min(_GROWTH * strength_A, most_A)
        if room_V(stronger_A) >= 0.0:
            strength_A = stronger_A
        elif room_V(0.0) <= 0.0:
            strength_A = 0.0
        else:
            strength_A = float(brentq(room_V, 0.0, stronger_A, xtol=_CURRENT_TOLERANCE_A))
        if strength_A < _LEAST_A:
            charges.append(soc)
            strengths_A.append(0.0)
            break
        _, end = cell.step(-strength_A, temperature_K, step_s)
        cell.keep()
        soc = end.soc
        charges.append(soc)
        strengths_A.append(strength_A)
    return np.array(charges), np.array(strengths_A)


def least_anode_potential_V(
    cell: Anode, temperature_K: float, strength_A: Callable[[float], float]
) -> tuple[float, float]:
    """Least anode potential (V) of a charge and the state of charge there.

    The current (A) follows the state of charge, from rest at the cell's beginning until FULL or
    the current ends.
    """
    cell.restart()
    soc, least_V, at_soc = 0.0, np.inf, 0.0
    while soc < FULL - _NEAR:
        rise = min(SOC_STEP, FULL - soc)
        # What the end is allowed, where the potential is least.
        now_A = strength_A(soc + rise)
        if now_A < _LEAST_A:
            break
        begin, end = cell.step(-now_A, temperature_K, rise * cell.capacity_As / now_A)
        cell.keep()
        for moment in (begin, end):
            if moment.anode_potential_V < least_V:
                least_V, at_soc = moment.anode_potential_V, moment.soc
        soc = end.soc
    return float(least_V), float(at_soc)
