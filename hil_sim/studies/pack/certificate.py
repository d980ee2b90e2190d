"""The certificate of a pack: what is proven of each cell beside its neighbours, and what is not.

Every cell's interval is sufficient for that cell, whatever the current inside of it, so that a pack
is certified where each of its cells is: at all corners of the spread and at cells inside of it,
with the neighbours as a disturbance within its bound. docs/pack.md has the argument.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bms.cell import scaled
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.verification.conditions import firmware_constants
from bms.verification.family import verify_family
from hil_sim.studies.pack.cell_certificates import (
    CellCase,
    covered_coupling_K_per_s,
    spread_ends,
    warmest_coolant_K,
    worst_cell,
)
from hil_sim.studies.pack.certificate_claims import (
    Claim,
    charged_claims,
    core_claim,
    electrical_claims,
    neighbours_claim,
    surface_claim,
)
from hil_sim.studies.pack.coupling import coupling_K_per_s
from hil_sim.studies.pack.engine import Core, View
from hil_sim.studies.pack.reserves import ESTIMATE_ERROR_K, Reserves, reserves
from hil_sim.studies.pack.spread import Spread, Surroundings
from hil_sim.studies.pack.trial_packs import Trials, charge_trials

INNER_CELLS = 8
"""Cells that are drawn inside of the spread."""
PARTS = 4
"""Of a certificate: the electrical limits, the core, the neighbours, and packs charged."""
FAMILY_PARTS = 1

NOT_PROVEN = (
    "the surface's own condition with coupling: the surface is kept by way of the core",
    "an error of the core's estimate beyond its bound and the reserve of "
    f"{ESTIMATE_ERROR_K:g} K for cells that are not the network's",
    "cells inside of the spread beyond those drawn, and coolant that warms unevenly by more than "
    "one cell's heat",
    "contactors, pre-charge, insulation, wiring: assumptions of use",
)
_BARE_NOT_PROVEN = (
    "the bound on a cell without thermistor between the corners of the spread, and for a pack that "
    "was not at rest and at one temperature when it was switched on"
)
_FAMILY_NOT_PROVEN = (
    "what neighbours and the coolant of a string do to a family's observer: it is not in the "
    "family's constants; `bms pack` charges such packs, which is evidence and no proof",
)


@dataclass(frozen=True)
class PackCertificate:
    """What was shown of every pack of cells of a spread; `certified` when each claim holds.

    `reserves` are the constants in force beside the preset's own, `core_margin` what the core's
    margin consists of and up to which coupling it lasts.
    """

    preset: str
    model: str
    cells: int
    thermistors: int
    spread: Spread | None
    around: Surroundings
    cells_checked: int
    claims: tuple[Claim, ...]
    reserves: dict[str, dict[str, float]]
    core_margin: dict[str, float]
    trials: Trials | None
    not_proven: tuple[str, ...]
    speaks_for: tuple[str, ...]
    wall_time_s: float

    @property
    def certified(self) -> bool:
        """Whether every claim holds."""
        return all(claim.holds for claim in self.claims)

    def as_dict(self) -> dict[str, Any]:
        """Content for JSON: plain numbers, lists and mappings."""
        return {**asdict(self), "certified": self.certified}


def certify_pack(
    preset: Preset,
    model: KanModel,
    spread: Spread,
    around: Surroundings,
    view: View,
    kept: Reserves | None = None,
    note: Callable[[str], None] = lambda part: None,
) -> PackCertificate:
    """Certify a pack's constants, those of `reserves` or `kept` in their place.

    `note` is told which of the PARTS comes next, or of FAMILY_PARTS. Raises InputError as
    `reserves` does.
    """
    begin = time.monotonic()
    cells = len(view.cells)
    if preset.cell.interval is not None:
        return _family(preset, model, around, cells, note, begin)
    kept = reserves(preset, spread, around) if kept is None else kept
    core = Core(preset, model, kept)
    bound_K_per_s = coupling_K_per_s(preset, spread, around)
    constants = firmware_constants(preset, model, kept.changes)
    worst = worst_cell(preset.cell, spread)
    rng = np.random.default_rng(0)
    factors = [*spread_ends(spread), *(spread.factors(rng) for _ in range(INNER_CELLS))]
    cases = [
        CellCase(
            preset, scaled(preset.cell, one), worst, constants, bound_K_per_s, ESTIMATE_ERROR_K
        )
        for one in factors
    ]
    note("voltage and state of charge of each cell")
    claims = electrical_claims(preset, cases)
    note("core of each cell")
    # The capacity is in no thermal condition.
    thermal = [case for case in cases if case.cell.capacity_As <= worst.capacity_As] + cases[
        -INNER_CELLS:
    ]
    claims += [core_claim(preset, thermal), surface_claim(preset, cases)]
    note("neighbours")
    claims.append(neighbours_claim(preset, spread, around, bound_K_per_s))
    is_kept = all(claim.holds for claim in claims)
    covered = covered_coupling_K_per_s(thermal, bound_K_per_s) if is_kept else 0.0
    note("packs")
    trials = charge_trials(core, spread, around, view, cells)
    claims += charged_claims(trials, bound_K_per_s)
    own = firmware_constants(preset, model)
    return PackCertificate(
        preset=preset.name,
        model=model.hash[:8],
        cells=cells,
        thermistors=len(view.thermistors),
        spread=spread,
        around=around,
        cells_checked=len(cases),
        claims=tuple(claims),
        reserves={
            name: {"preset": float(own[name]), "pack": float(constants[name])}
            for name in kept.changes
        },
        core_margin=_core_margin(preset, constants, own, bound_K_per_s, covered),
        trials=trials,
        not_proven=NOT_PROVEN
        if len(view.thermistors) == cells
        else (*NOT_PROVEN, _BARE_NOT_PROVEN),
        speaks_for=_speaks_for(preset, spread, around, cases),
        wall_time_s=time.monotonic() - begin,
    )


def _core_margin(
    preset: Preset, constants: Any, own: Any, bound_K_per_s: float, covered_K_per_s: float
) -> dict[str, float]:
    hold_s = preset.timing.sampling_period_s + preset.timing.delay_s
    strongest_A = -preset.limits.reference_current_A
    coupling = float(constants["a1_per_s"]) * hold_s * bound_K_per_s
    estimate = abs(float(constants["a2_per_As"])) * strongest_A * ESTIMATE_ERROR_K
    whole = float(constants["core_margin_K_per_s"])
    return {
        "whole_K_per_s": whole,
        "neighbours_K_per_s": coupling,
        "estimate_K_per_s": estimate,
        "sampling_K_per_s": whole - coupling - estimate,
        "preset_K_per_s": float(own["core_margin_K_per_s"]),
        "coupling_bound_K_per_s": bound_K_per_s,
        "coupling_covered_K_per_s": covered_K_per_s,
        "preset_surface_K_per_s": preset.uncertainty.surface_K_per_s,
    }


def _speaks_for(
    preset: Preset, spread: Spread, around: Surroundings, cases: list[CellCase]
) -> tuple[str, ...]:
    def of(name: str, ends: tuple[float, float]) -> str:
        return f"{name} {ends[0]:.3f} to {ends[1]:.3f}"

    factors = ", ".join(
        (
            of("Rc", spread.core_resistance),
            of("Cc", spread.core_heat_capacity),
            of("Rs", spread.surface_resistance),
            of("R0", spread.resistance),
            of("capacity", spread.capacity),
        )
    )
    coolant_K = min(warmest_coolant_K(preset, case.cell) for case in cases)
    return (
        f"cells of {preset.name} in series, without polarisation, times {factors}",
        f"neighbours that conduct {around.neighbour_W_per_K:g} W/K or less, coolant of "
        f"{around.flow_W_per_K:g} W/K or more, below {coolant_K:.3f} K",
        "at rest and at one temperature when plugged in, each cell's state of charge told then",
    )


def _family(
    preset: Preset,
    model: KanModel,
    around: Surroundings,
    cells: int,
    note: Callable[[str], None],
    begin: float,
) -> PackCertificate:
    """Each cell is certified by its family; what it does not know of are its neighbours."""
    note("the family of the cells")
    family = verify_family(preset, model)
    is_apart = cells == 1 or around.neighbour_W_per_K == 0.0
    limits = preset.limits
    claims = (
        Claim(
            "each cell",
            "the family's certificate, for a cell by itself",
            family.certified,
            limits.max_core_temperature_K,
            0.0,
            "K",
            "" if family.certified else f"see 'bms verify --preset {preset.name}'",
        ),
        Claim(
            "neighbours",
            "what they do to a surface is a disturbance that the constants have in them",
            is_apart,
            preset.uncertainty.surface_K_per_s,
            0.0,
            "K/s",
            "" if is_apart else "a family's constants know of no neighbours",
        ),
    )
    return PackCertificate(
        preset=preset.name,
        model=model.hash[:8],
        cells=cells,
        thermistors=cells,
        spread=None,
        around=around,
        cells_checked=0,
        claims=claims,
        reserves={},
        core_margin={},
        trials=None,
        not_proven=(*_FAMILY_NOT_PROVEN, NOT_PROVEN[-1]),
        speaks_for=(f"cells anywhere in the intervals of {preset.name}, a thermistor each",),
        wall_time_s=time.monotonic() - begin,
    )
