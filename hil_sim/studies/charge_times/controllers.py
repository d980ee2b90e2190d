"""The controllers of the comparison, and what each of them does from a start.

The planned charge, multi-stage and MPC run over the bus, the others in the campaign's C runner,
which is the same charge; all with the preset's sensors and the bus's steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from bms.presets import Preset
from hil_sim.bus.catalog import Mode
from hil_sim.bus.database import MessageCodec
from hil_sim.nodes.ecu import EcuLike
from hil_sim.nodes.python_ecu import PythonEcu
from hil_sim.nodes.views import TrueState
from hil_sim.plant.seam import PlantLike
from hil_sim.run.result import STOP_COMPLETE, RunResult
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from hil_sim.studies.campaign.engine import CampaignCharge
from hil_sim.studies.campaign.rows import FIRMWARE
from hil_sim.studies.charge_times.native import charge_in_c
from hil_sim.studies.charge_times.predictive import PredictiveController

LONGEST_SHARE = 4.0
"""A charge is given up after so many times its bound."""
UNFILLED_SOC = 0.005
"""A cell that lacks more than this of the state of charge of a full one is not full."""
DATA_SHEET_A = 10.0
"""The data sheet's fast charge of the A123 26650."""
TUNED_PARTS, TUNED_STEPS = 20, 5
"""CC-CV is tried at as many parts of the reference current, then finer beside the best of them."""


@dataclass(frozen=True)
class Rival:
    """How a controller is run, with its name, from a preset's start for at most a time in s.

    A certified one claims to keep every limit, so that a crossed one fails the command.
    """

    title: str
    play: Callable[[str, Preset, float], Played]
    is_certified: bool = False


@dataclass(frozen=True)
class Played:
    """What a controller made of a start; figures over limits are negative where they were kept.

    Peaks are those of the simulated cell at ten instants a period. `set_A` is the current that
    CC-CV was set to in place of the reference.
    """

    controller: str
    charge_time_s: float | None
    stop_reason: str
    final_soc: float
    core_over_K: float
    surface_over_K: float
    voltage_over_V: float
    soc_over: float
    max_core_temperature_K: float
    mean_core_temperature_K: float
    heat_J: float
    set_A: float | None = None

    @property
    def crossed(self) -> dict[str, float]:
        """By how much each crossed limit was crossed: core and surface in K, voltage in V, SoC."""
        overs = {
            "core": self.core_over_K,
            "surface": self.surface_over_K,
            "voltage": self.voltage_over_V,
            "soc": self.soc_over,
        }
        return {limit: over for limit, over in overs.items() if over > 0.0}


def _played(name: str, preset: Preset, result: RunResult) -> Played:
    """Of a charge over the bus."""
    summary = result.summary
    assert summary.mean_core_temperature_K is not None
    assert summary.heat_J is not None
    return _over_limits(
        preset,
        controller=name,
        charge_time_s=summary.charge_time_s,
        stop_reason=summary.stop_reason,
        final_soc=summary.final_soc,
        peaks=(
            summary.max_core_temperature_K,
            summary.max_surface_temperature_K,
            summary.max_voltage_V,
            summary.max_soc,
        ),
        mean_core_temperature_K=summary.mean_core_temperature_K,
        heat_J=summary.heat_J,
    )


def _played_in_c(name: str, preset: Preset, charge: CampaignCharge) -> Played:
    fields, peaks = charge.fields, charge.fields.peaks.cell
    return _over_limits(
        preset,
        controller=name,
        charge_time_s=fields.time_s if charge.outcome == STOP_COMPLETE else None,
        stop_reason=charge.outcome,
        final_soc=fields.memory.state.soc,
        peaks=(
            peaks.core_temperature_K,
            peaks.surface_temperature_K,
            peaks.voltage_V,
            peaks.soc,
        ),
        mean_core_temperature_K=charge.mean_core_temperature_K,
        heat_J=fields.heat_J,
    )


def _over_limits(
    preset: Preset,
    *,
    controller: str,
    charge_time_s: float | None,
    stop_reason: str,
    final_soc: float,
    peaks: tuple[float, float, float, float],
    mean_core_temperature_K: float,
    heat_J: float,
) -> Played:
    limits = preset.limits
    core_K, surface_K, voltage_V, soc = peaks
    is_full = final_soc >= limits.completion_soc - UNFILLED_SOC
    return Played(
        controller=controller,
        charge_time_s=charge_time_s if is_full else None,
        stop_reason=stop_reason,
        final_soc=final_soc,
        core_over_K=core_K - limits.max_core_temperature_K,
        surface_over_K=surface_K - limits.max_surface_temperature_K,
        voltage_over_V=voltage_V - limits.max_voltage_V,
        soc_over=soc - limits.max_soc,
        max_core_temperature_K=core_K,
        mean_core_temperature_K=mean_core_temperature_K,
        heat_J=heat_J,
    )


def _planned(name: str, preset: Preset, longest_s: float) -> Played:
    settings = Settings(preset, mode=Mode.FASTEST, max_time_s=longest_s)
    return _played(name, preset, run_both(settings))


def _fixed(name: str, preset: Preset, longest_s: float) -> Played:
    charge = charge_in_c(preset, FIRMWARE, longest_s, mode=Mode.FIXED)
    return _played_in_c(name, preset, charge)


def _s_cbf(name: str, preset: Preset, longest_s: float) -> Played:
    return _played_in_c(name, preset, charge_in_c(preset, "s-cbf", longest_s))


def _cc_cv(name: str, preset: Preset, longest_s: float) -> Played:
    return _played_in_c(name, preset, charge_in_c(preset, "cc-cv", longest_s))


def _cc_cv_set(name: str, preset: Preset, longest_s: float, strongest_A: float) -> Played:
    """CC-CV that is set to a current, whatever the reference is."""
    charge = charge_in_c(preset, "cc-cv", longest_s, strongest_A=strongest_A)
    return replace(_played_in_c(name, preset, charge), set_A=strongest_A)


def _cc_cv_data_sheet(name: str, preset: Preset, longest_s: float) -> Played:
    return _cc_cv_set(name, preset, longest_s, DATA_SHEET_A)


def _cc_cv_tuned(name: str, preset: Preset, longest_s: float) -> Played:
    """CC-CV at the current with which, of those that cross no limit, it is full soonest.

    That is hindsight: no charger knows the core. The weakest current where none keeps the limits.
    """
    reference_A = -preset.limits.reference_current_A
    tried: dict[float, Played] = {}

    def best(currents_A: list[float]) -> float:
        for current_A in currents_A:
            if current_A not in tried and 0.0 < current_A <= reference_A:
                tried[current_A] = _cc_cv_set(name, preset, longest_s, current_A)
        kept = [(one.charge_time_s, a) for a, one in tried.items() if not one.crossed]
        full = [(time_s, a) for time_s, a in kept if time_s is not None]
        return min(full)[1] if full else min(tried)

    coarse_A = reference_A / TUNED_PARTS
    middle_A = best([coarse_A * part for part in range(1, TUNED_PARTS + 1)])
    steps = range(-TUNED_STEPS, TUNED_STEPS + 1)
    return tried[best([middle_A + coarse_A * step / TUNED_STEPS for step in steps if step])]


def _multi_stage(name: str, preset: Preset, longest_s: float) -> Played:
    settings = Settings(preset, controller=ControllerKind.MULTI_STAGE, max_time_s=longest_s)
    return _played(name, preset, run_both(settings))


def _predictive(name: str, preset: Preset, longest_s: float) -> Played:
    settings = Settings(preset, controller=ControllerKind.S_CBF, max_time_s=longest_s)

    def make(plant: PlantLike, database: dict[str, MessageCodec]) -> EcuLike:
        return PythonEcu(lambda: PredictiveController(preset), preset, database, TrueState(plant))

    return _played(name, preset, run_both(settings, ecu_factory=make))


PLANNED = "kan-rcbf-fastest"
TUNED = "cc-cv-tuned"

RIVALS: Mapping[str, Rival] = MappingProxyType(
    {
        PLANNED: Rival("KAN-rCBF, planned", _planned, is_certified=True),
        "kan-rcbf-fixed": Rival("KAN-rCBF at 10C", _fixed, is_certified=True),
        "s-cbf": Rival("S-CBF", _s_cbf),
        "cc-cv": Rival("CC-CV at 10C", _cc_cv),
        "cc-cv-data-sheet": Rival("CC-CV at 10 A", _cc_cv_data_sheet),
        TUNED: Rival("CC-CV, tuned in hindsight", _cc_cv_tuned),
        "multi-stage": Rival("multi-stage", _multi_stage),
        PredictiveController.name: Rival("MPC with true states", _predictive),
    }
)
"""Every controller by its name in files, in the order of the table."""


def play(name: str, preset: Preset, bound_s: float) -> Played:
    """The charge of a controller from the start of a preset. Raises what run_both does."""
    return RIVALS[name].play(name, preset, LONGEST_SHARE * bound_s)
