"""The slips in the paper's printed formulas, as changes of the constants that are decided by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from bms.presets import Preset
from bms.verification.conditions import ErrorTerm

Change = Callable[[Preset, dict[str, Any]], dict[str, Any]]


class Formulas(str, Enum):
    """Which formulas the constants follow."""

    CORRECTED = "corrected"
    PAPER = "paper"


@dataclass(frozen=True)
class Slip:
    """One slip: where it stands, what is printed, and the constants that it changes."""

    name: str
    printed: str
    change: Change


def _resistance(preset: Preset, _: dict[str, Any]) -> dict[str, Any]:
    cell = preset.cell
    return {
        "a9_K_per_A2s2": -cell.surface_resistance_K_per_W
        / (
            cell.core_resistance_K_per_W
            * cell.core_heat_capacity_J_per_K
            * cell.surface_heat_capacity_J_per_K
        )
    }


def _coolant_capacity(preset: Preset, constants: dict[str, Any]) -> dict[str, Any]:
    cell = preset.cell
    surface = cell.surface_resistance_K_per_W * cell.surface_heat_capacity_J_per_K
    change = 1.0 / cell.capacity_As - 1.0 / cell.coolant_heat_capacity_J_per_K
    return {
        "a6_per_s2": constants["a6_per_s2"] + change / (surface * cell.surface_resistance_K_per_W),
        "a10_K_per_Ws2": 1.0 / (surface * cell.capacity_As),
    }


def _core_sign(_: Preset, constants: dict[str, Any]) -> dict[str, Any]:
    return {"core_uncertainty_K_per_s": -constants["core_uncertainty_K_per_s"]}


def _surface_sign(_: Preset, constants: dict[str, Any]) -> dict[str, Any]:
    return {"delta4_K_per_s2": -constants["delta4_K_per_s2"]}


def _no_margins(_: Preset, constants: dict[str, Any]) -> dict[str, Any]:
    return {name: 0.0 for name in constants if name.endswith(("margin_V", "_margin_per_s"))} | {
        "core_margin_K_per_s": 0.0,
        "surface_margin_K_per_s2": 0.0,
        "soc_error": 0.0,
    }


def _no_surface_error(_: Preset, __: dict[str, Any]) -> dict[str, Any]:
    return {"surface_error_term": ErrorTerm.NONE}


def _signed_core_error(_: Preset, __: dict[str, Any]) -> dict[str, Any]:
    return {"core_error_term": ErrorTerm.SIGNED}


SLIPS = (
    Slip("a9-resistance", "A9 = -Rs/(Rc Cc Cs) instead of -R0/(Rc Cc Cs)", _resistance),
    Slip("coolant-capacity", "C_bat instead of Cinf in A5, A6, A10", _coolant_capacity),
    Slip("core-sign", "+ nu_c instead of - nu_c in the core constraint", _core_sign),
    Slip("core-error-sign", "E > 0 assumed in the core's error term", _signed_core_error),
    Slip("surface-error", "no margin for the estimate's error in the surface constraint",
         _no_surface_error),
    Slip("no-margins", "no margins for sampling, delay, sensors and bus", _no_margins),
)  # fmt: skip
"""Slips that the printed proposition has, all of which Formulas.PAPER puts in at once."""

CLASHING_DELTA4 = Slip(
    "delta4-sign", "the appendix' positive Delta4 in the proposition's + Delta4", _surface_sign
)
"""The table's Delta4 is negative, the appendix' positive: the proposition holds with the first."""


def with_slips(
    preset: Preset, constants: dict[str, Any], slips: tuple[Slip, ...]
) -> dict[str, Any]:
    """Constants with slips put in."""
    changed = dict(constants)
    for slip in slips:
        changed |= slip.change(preset, changed)
    return changed


def slips_of(formulas: Formulas) -> tuple[Slip, ...]:
    """The slips that a choice of formulas contains."""
    return SLIPS if formulas is Formulas.PAPER else ()
