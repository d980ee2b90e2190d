"""The margins of the controller, one by one, and what the controller is without each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

_UNLIMITED_GROWTH_A = 100.0


@dataclass(frozen=True)
class Margin:
    """A name, whether the paper's method has it too, and the calibration constants without it."""

    name: str
    in_paper: bool
    changes: Mapping[str, float] = field(hash=False)


_SAMPLING = {
    "voltage": {"voltage_margin_V": 0.0},
    "state of charge": {"soc_margin_per_s": 0.0},
    "core": {"core_margin_K_per_s": 0.0},
    "surface": {"surface_margin_K_per_s2": 0.0},
}
_GROWTH = {"current_growth_A": _UNLIMITED_GROWTH_A}
_ERROR_BOUND = {"estimation_error_bound_K": 0.0}
_UNCERTAINTY = {
    "delta4_K_per_s2": 0.0,
    "core_uncertainty_K_per_s": 0.0,
    "soc_uncertainty_per_s": 0.0,
}
_ALL_SAMPLING = {key: value for part in _SAMPLING.values() for key, value in part.items()}

OURS_TOGETHER, EVERYTHING = "all of ours", "every margin"

SINGLE_MARGINS = (
    *(Margin(f"sampling, {name}", False, changes) for name, changes in _SAMPLING.items()),
    Margin("growth of the current", False, _GROWTH),
    Margin("estimation error bound", True, _ERROR_BOUND),
    Margin("model uncertainty", True, _UNCERTAINTY),
)
MARGINS = (
    *SINGLE_MARGINS,
    Margin(OURS_TOGETHER, False, {**_ALL_SAMPLING, **_GROWTH}),
    Margin(EVERYTHING, False, {**_ALL_SAMPLING, **_GROWTH, **_ERROR_BOUND, **_UNCERTAINTY}),
)
"""Each is left out in a run of its own; the last two leave out several at once."""
