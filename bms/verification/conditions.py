"""The two thermal conditions in one form: those that must hold and those that are decided by.

What must hold comes from the preset's cell; what is decided by comes from the firmware's own
calibration block, rounded to float32 where it is, or from a block with slips put in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from bms.barrier import barrier_constants
from bms.barrier.machinery import check_gains
from bms.calibration import NO_CHANGES
from bms.cell import OpenCircuitVoltage
from bms.firmware.calibration import calibration_block
from bms.model.model_file import KanModel
from bms.presets import Preset


class ErrorTerm(str, Enum):
    """What is subtracted for the error e of the estimate, with slope p + q u of the condition."""

    ABSOLUTE = "|p + q u| e"
    SIGNED = "-q u e"
    NONE = "0"


@dataclass(frozen=True)
class Condition:
    """core_gap (Tc - Ts) + coolant_gap (Tinf - Ts) + room (limit - Ts) + coupling Tc u
    + squared u^2 + cooling Qc - reserve, which must not be negative."""

    limit_K: float
    core_gap: float
    coolant_gap: float
    room: float
    coupling: float
    squared: float
    cooling: float
    reserve: float
    error_term: ErrorTerm = ErrorTerm.NONE
    error_bound_K: float = 0.0

    def value(
        self, core_K: Any, surface_K: Any, coolant_K: Any, current_A: Any, cooling_W: Any
    ) -> Any:
        """Left-hand side without the error term; floats or arrays."""
        return (
            self.core_gap * (core_K - surface_K)
            + self.coolant_gap * (coolant_K - surface_K)
            + self.room * (self.limit_K - surface_K)
            + self.coupling * core_K * current_A
            + self.squared * current_A * current_A
            + self.cooling * cooling_W
            - self.reserve
        )

    def less(self, other: Condition) -> Condition:
        """The condition whose value is this one's less the other's, both without error terms.

        Equal coefficients cancel here, before any interval is formed.
        """
        shift = self.room * (self.limit_K - other.limit_K)
        return Condition(
            other.limit_K,
            self.core_gap - other.core_gap,
            self.coolant_gap - other.coolant_gap,
            self.room - other.room,
            self.coupling - other.coupling,
            self.squared - other.squared,
            self.cooling - other.cooling,
            self.reserve - other.reserve - shift,
        )

    def times(self, factor: float) -> Condition:
        """The same condition in another unit: all but limit and error term times a factor."""
        return replace(
            self,
            core_gap=factor * self.core_gap,
            coolant_gap=factor * self.coolant_gap,
            room=factor * self.room,
            coupling=factor * self.coupling,
            squared=factor * self.squared,
            cooling=factor * self.cooling,
            reserve=factor * self.reserve,
        )

    def branches(self) -> tuple[tuple[float, float], ...]:
        """Terms (constant, per ampere), the smallest of which is the error term at any current."""
        p, q, e = self.core_gap, self.coupling, self.error_bound_K
        if self.error_term is ErrorTerm.ABSOLUTE:
            return ((-p * e, -q * e), (p * e, q * e))
        return ((0.0, q * e),) if self.error_term is ErrorTerm.SIGNED else ((0.0, 0.0),)


@dataclass(frozen=True)
class Chain:
    """Gains of the surface barrier's chain psi = B4' + first B4, psi' + second psi >= 0."""

    first_per_s: float
    second_per_s: float


def chains(preset: Preset) -> tuple[Chain, Chain]:
    """Both chains of the surface barrier; the first, with the larger root, asks less of a state."""
    smaller, larger = check_gains([preset.gains.alpha3_per_s2, preset.gains.alpha4_per_s])
    return Chain(larger, smaller), Chain(smaller, larger)


def required_conditions(preset: Preset) -> tuple[Condition, Condition]:
    """Core and surface condition in continuous time at the worst disturbance, for true values."""
    cell, limits = preset.cell, preset.limits
    a = barrier_constants(cell, preset)
    gain = preset.gains.core_gain_per_s(cell)
    core = Condition(
        limits.max_core_temperature_K, a.a1_per_s - gain, 0.0, gain,
        a.a2_per_As, -a.a3_K_per_A2s, 0.0, preset.uncertainty.core_K_per_s,
    )  # fmt: skip
    surface = Condition(
        limits.max_surface_temperature_K, a.a4_per_s2, a.a6_per_s2, preset.gains.alpha3_per_s2,
        a.a8_per_As2, a.a9_K_per_A2s2, a.a10_K_per_Ws2, a.delta4_K_per_s2,
    )  # fmt: skip
    return core, surface


def firmware_constants(
    preset: Preset, model: KanModel, changes: Mapping[str, float] = NO_CHANGES
) -> dict[str, Any]:
    """What the firmware decides by, read back from its calibration block: scalars and table.

    `changes` as in bms.calibration.calibration_fields.
    """
    calibration = calibration_block(preset, model, compiled_in=False, changes=changes)
    block = calibration.rcbf
    names = [name for name in dir(block) if not name.startswith("ocv_")]
    limits = ("max_core_temperature_K", "max_surface_temperature_K")
    return {
        **{name: getattr(block, name) for name in names if name not in limits},
        **{name: getattr(block, name).high_K + getattr(block, name).low_K for name in limits},
        "ocv": OpenCircuitVoltage(
            tuple(block.ocv_soc[0 : block.ocv_points]), tuple(block.ocv_V[0 : block.ocv_points])
        ),
        "completion_soc": calibration.completion_soc,
        "soc_error": calibration.soc_error,
        "core_error_term": ErrorTerm.ABSOLUTE,
        "surface_error_term": ErrorTerm.ABSOLUTE,
    }


def decided_conditions(constants: Mapping[str, Any]) -> tuple[Condition, Condition]:
    """Core and surface condition that a decision by these constants fulfils."""
    k = constants
    core = Condition(
        k["max_core_temperature_K"], k["a1_per_s"] - k["alpha2_per_s"], 0.0, k["alpha2_per_s"],
        k["a2_per_As"], -k["a3_K_per_A2s"], 0.0,
        k["core_uncertainty_K_per_s"] + k["core_margin_K_per_s"],
        k["core_error_term"], k["estimation_error_bound_K"],
    )  # fmt: skip
    surface = Condition(
        k["max_surface_temperature_K"], k["a4_per_s2"], k["a6_per_s2"], k["alpha3_per_s2"],
        k["a8_per_As2"], k["a9_K_per_A2s2"], k["a10_K_per_Ws2"],
        k["delta4_K_per_s2"] + k["surface_margin_K_per_s2"],
        k["surface_error_term"], k["estimation_error_bound_K"],
    )  # fmt: skip
    return core, surface
