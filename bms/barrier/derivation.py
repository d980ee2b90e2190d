"""The cell's four conditions, derived in symbols from bms/cell/model.py alone.

The model's own right-hand side is evaluated with symbols in place of numbers, so that neither this
page nor the paper has to be trusted. Needs sympy.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from bms.barrier.machinery import (
    AffineModel,
    BarrierCondition,
    derive_condition,
    estimation_margin,
    require_sympy,
)
from bms.cell import CellState, Disturbance, rates
from bms.presets import Preset

_POSITIVE = (
    "capacity_As core_resistance_K_per_W core_heat_capacity_J_per_K surface_resistance_K_per_W "
    "surface_heat_capacity_J_per_K coolant_heat_capacity_J_per_K ohmic_resistance_ohm "
    "max_soc max_core_temperature_K max_surface_temperature_K "
    "alpha1_per_s alpha2_per_s alpha3_per_s2 alpha4_per_s "
    "soc_per_s core_K_per_s surface_K_per_s coolant_K_per_s surface_rate_K_per_s2 "
    "estimation_error_bound_K"
).split()
_REAL = (
    "entropic_coefficient_V_per_K soc core_temperature_K surface_temperature_K "
    "coolant_temperature_K current_A cooling_power_W"
).split()


@dataclass(frozen=True)
class Derivation:
    """The model, the conditions of SoC, core and surface, and the symbols by parameter name.

    The voltage condition has no derivative in it: its barrier contains the current itself.
    """

    symbols: SimpleNamespace
    model: AffineModel
    soc: BarrierCondition
    core: BarrierCondition
    surface: BarrierCondition

    def worst_case(self, name: str) -> Any:
        """Condition "soc", "core" or "surface" at the worst disturbance and true temperatures."""
        s = self.symbols
        noise = self.model.disturbance
        condition: BarrierCondition = getattr(self, name)
        bounds = dict(zip(noise, (s.soc_per_s, s.core_K_per_s, s.surface_K_per_s)))
        bounds[noise[3]] = s.coolant_K_per_s
        bounds[condition.disturbances[1][2]] = s.surface_rate_K_per_s2
        return condition.worst_case(bounds)

    def robust(self, name: str) -> Any:
        """The same for a core temperature that is known to estimation_error_bound_K only."""
        s, value = self.symbols, self.worst_case(name)
        return value - estimation_margin(value, s.core_temperature_K, s.estimation_error_bound_K)

    def values(self, preset: Preset, error_bound_K: float) -> dict[Any, float]:
        """The number of each parameter symbol for a preset; states and inputs stay symbols."""
        cell, limits, gains = preset.cell, preset.limits, preset.gains
        numbers = {
            name: getattr(source, name)
            for source in (cell, limits, gains, preset.uncertainty)
            for name in (*_POSITIVE, "entropic_coefficient_V_per_K")
            if hasattr(source, name)
        }
        numbers |= {
            "alpha2_per_s": gains.core_gain_per_s(cell),
            "estimation_error_bound_K": error_bound_K,
        }
        return {getattr(self.symbols, name): value for name, value in numbers.items()}


def derive_cell_conditions() -> Derivation:
    """Relative degrees, Lie derivatives and uncertainty terms of the cell's barriers.

    Raises InputError when sympy is not installed.
    """
    sympy = require_sympy()
    s = SimpleNamespace(
        **{name: sympy.Symbol(name, positive=True) for name in _POSITIVE},
        **{name: sympy.Symbol(name, real=True) for name in _REAL},
    )
    states = CellState(
        s.soc, s.core_temperature_K, s.surface_temperature_K, s.coolant_temperature_K
    )
    noise = Disturbance(*sympy.symbols("nu_soc nu_core nu_surface nu_coolant", real=True))
    # The parameters are symbols with the names of CellParameters.
    cell: Any = s
    field = [sympy.expand(rate) for rate in rates(cell, states, s.current_A, s.cooling_power_W)]
    inputs = {"u": s.current_A, "u^2": s.current_A**2, "Qc": s.cooling_power_W}
    columns = {
        "u": tuple(rate.coeff(s.current_A, 1) for rate in field),
        "u^2": tuple(rate.coeff(s.current_A, 2) for rate in field),
        "Qc": tuple(rate.coeff(s.cooling_power_W, 1) for rate in field),
    }
    drift = tuple(rate.subs({s.current_A: 0, s.cooling_power_W: 0}) for rate in field)
    model = AffineModel(tuple(states), drift, inputs, columns, tuple(noise))
    return Derivation(
        symbols=s,
        model=model,
        soc=derive_condition(model, s.max_soc - s.soc, [s.alpha1_per_s]),
        core=derive_condition(
            model, s.max_core_temperature_K - s.core_temperature_K, [s.alpha2_per_s]
        ),
        surface=derive_condition(
            model,
            s.max_surface_temperature_K - s.surface_temperature_K,
            [s.alpha3_per_s2, s.alpha4_per_s],
        ),
    )
