"""What the time to full is made of: the bound, and what each thing that is allowed for adds to it.

The firmware charges again and again, with one thing more left out each time, so that the
differences add up. Without them limits may be crossed; only the time is looked at.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from bms.barrier import Margins, sampling_margins
from bms.barrier.readings import soc_reserve
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Initial, Sensor, Sensors
from bms.studies.optimum.bound import lower_bound
from bms.studies.optimum.charge import charge_of
from hil_sim.studies.tuning.charges import outcomes, tuning_starts

_NO_RAMP_A = 1e3
_PERFECT = Sensor(resolution=0.0, noise_std=0.0, bias=0.0)


@dataclass(frozen=True)
class Part:
    """A thing that takes time, and the firmware's constants without it."""

    name: str
    changes: Mapping[str, float]
    noise: float = 1.0


@dataclass(frozen=True)
class Gap:
    """Charge from one start: bound by physics alone, time to full, and the parts between, in s.

    `parts_s` has a number for each name of PART_NAMES and adds up to time less bound.
    """

    start: Initial
    bound_s: float
    time_s: float
    parts_s: tuple[float, ...]


PART_NAMES = (
    "ramp",
    "error bound of the estimate",
    "errors of the sensors",
    "sampling, delay, bus, float32",
    "disturbances",
    "one constant current, then the barriers' approach",
)


def gaps(
    preset: Preset, model: KanModel, told: Callable[[str], None] = lambda doing: None
) -> list[Gap]:
    """The gap of each of the search's starts; `told` hears of what is computed.

    Raises InputError without cvxpy, and where a start cannot be charged by physics.
    """
    starts = tuning_starts(preset)
    bounds_s = []
    for start in starts:
        told("bounds")
        charge = charge_of(preset, start.temperature_K, start.soc, start.cooling_power_W)
        bounds_s.append(lower_bound(charge.physics_alone()).time_s)
    columns = [[outcome.time_s for outcome in outcomes(preset, model, starts)]]
    changes: dict[str, float] = {}
    noise = 1.0
    for part in _parts(preset):
        told(f"without {part.name}")
        changes.update(part.changes)
        noise = min(noise, part.noise)
        played = outcomes(preset, model, starts, changes=changes, noise=noise)
        columns.append([outcome.time_s for outcome in played])
    columns.append(bounds_s)
    return [
        Gap(start, times[-1], times[0], tuple(a - b for a, b in itertools.pairwise(times)))
        for start, *times in zip(starts, *columns)
    ]


def _parts(preset: Preset) -> tuple[Part, ...]:
    perfect = replace(preset, sensors=Sensors(*[_PERFECT] * 5))
    with_perfect = _margin_changes(sampling_margins(preset.cell, perfect))
    reserve = soc_reserve(preset.cell, perfect)
    none = _margin_changes(Margins(0.0, 0.0, 0.0, 0.0))
    undisturbed = dict.fromkeys(
        ("core_uncertainty_K_per_s", "delta4_K_per_s2", "soc_uncertainty_per_s"), 0.0
    )
    changes: tuple[Mapping[str, float], ...] = (
        {"current_growth_A": _NO_RAMP_A},
        {"estimation_error_bound_K": 0.0},
        {**with_perfect, "soc_error": reserve},
        {**none, "soc_error": 0.0},
        undisturbed,
    )
    return tuple(
        Part(name, change, 0.0 if "soc_error" in change else 1.0)
        for name, change in zip(PART_NAMES, changes)
    )


def _margin_changes(margins: Margins) -> dict[str, float]:
    return {
        "voltage_margin_V": margins.voltage_V,
        "soc_margin_per_s": margins.soc_per_s,
        "core_margin_K_per_s": margins.core_K_per_s,
        "surface_margin_K_per_s2": margins.surface_K_per_s2,
    }
