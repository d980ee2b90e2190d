"""The claims of a pack's certificate, checked: limits of each cell, neighbours, packs charged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bms.barrier.rounding import UNIT
from bms.presets import Preset
from bms.verification.certificate import Certificate
from hil_sim.studies.pack.cell_certificates import (
    CellCase,
    certify_core,
    certify_electrical,
    warmest_coolant_K,
)
from hil_sim.studies.pack.coupling import neighbour_gap_K
from hil_sim.studies.pack.spread import Spread, Surroundings
from hil_sim.studies.pack.trial_packs import Trials

INNER_SPREADS = 8
"""Narrower spreads that are drawn inside of the spread."""


@dataclass(frozen=True)
class Claim:
    """One thing that has to hold: the bound, what is left of it, both in `unit`, and why not."""

    name: str
    claim: str
    holds: bool
    bound: float
    margin: float
    unit: str
    reason: str = ""


def electrical_claims(preset: Preset, cases: list[CellCase]) -> list[Claim]:
    """Voltage, state of charge, and the count that both rest on."""
    results = [certify_electrical(case) for case in cases]
    limits, constants = preset.limits, cases[0].constants
    voltage = Claim(
        "voltage",
        "no cell's voltage above its limit until the next decision acts",
        all(voltage.holds for voltage, _, _ in results),
        limits.max_voltage_V,
        min(distance_V for _, distance_V, _ in results),
        "V",
        _why([(voltage, case) for (voltage, _, _), case in zip(results, cases)]),
    )
    soc = Claim(
        "state of charge",
        "no cell's rate of charge above what its room allows, at any instant of the hold",
        all(soc.holds for _, _, soc in results),
        limits.max_soc,
        constants["soc_margin_per_s"] / constants["alpha1_per_s"],
        "1",
        _why([(soc, case) for (_, _, soc), case in zip(results, cases)]),
    )
    counted_As = constants["capacity_As"]
    smallest_As = min(case.cell.capacity_As for case in cases)
    is_counted = counted_As <= smallest_As * (1.0 + 2.0 * UNIT)
    count = Claim(
        "count",
        "no cell is fuller than counted: charge is counted by a capacity that none is below",
        is_counted,
        smallest_As,
        smallest_As - counted_As,
        "As",
        "" if is_counted else f"counted by {counted_As:g} As",
    )
    return [voltage, soc, count]


def core_claim(preset: Preset, cases: list[CellCase]) -> Claim:
    """Of each cell, up to the first that is not certified; the margin is the one in force."""
    reason = ""
    for case in cases:
        reason = _why([(certify_core(case), case)])
        if reason:
            break
    k = cases[0].constants
    return Claim(
        "core",
        "no cell's core above its limit until the next decision acts, neighbours disturbing",
        not reason,
        preset.limits.max_core_temperature_K,
        (k["core_margin_K_per_s"] + k["core_uncertainty_K_per_s"]) / k["alpha2_per_s"],
        "K",
        reason,
    )


def surface_claim(preset: Preset, cases: list[CellCase]) -> Claim:
    """By way of the core; the margin is what the coolant has to stay below the limit."""
    warmest_K = min(warmest_coolant_K(preset, case.cell) for case in cases)
    start_K = preset.initial.temperature_K
    return Claim(
        "surface",
        f"no surface above its limit where no core is and the coolant is below {warmest_K:.3f} K",
        warmest_K > start_K,
        preset.limits.max_surface_temperature_K,
        preset.limits.max_surface_temperature_K - warmest_K,
        "K",
        ""
        if warmest_K > start_K
        else f"the pack begins at {start_K:g} K; raise limits.max_surface_temperature_K",
    )


def neighbours_claim(
    preset: Preset, spread: Spread, around: Surroundings, bound_K_per_s: float
) -> Claim:
    """The bound is that of corners; cells of narrower spreads have to be nearer to each other."""
    rng = np.random.default_rng(0)
    inner = [_narrower(spread, rng) for _ in range(INNER_SPREADS)]
    most_K = max(neighbour_gap_K(preset, one, around) for one in inner)
    bound_K = neighbour_gap_K(preset, spread, around)
    return Claim(
        "neighbours",
        f"two surfaces side by side differ by less, which changes each by {bound_K_per_s:.3g} K/s "
        "at most",
        most_K <= bound_K,
        bound_K,
        bound_K - most_K,
        "K",
        "" if most_K <= bound_K else f"cells inside of the spread differ by {most_K:.3f} K",
    )


def _narrower(spread: Spread, rng: np.random.Generator) -> Spread:
    """Intervals between two random cells of a spread."""
    ends = [spread.factors(rng) for _ in range(2)]
    names = (
        "core_resistance", "core_heat_capacity", "surface_resistance", "resistance", "capacity",
    )  # fmt: skip
    intervals: dict[str, Any] = {
        name: tuple(sorted(getattr(end, name) for end in ends)) for name in names
    }
    return replace(spread, **intervals)


def charged_claims(trials: Trials, bound_K_per_s: float) -> list[Claim]:
    """What packs that were charged show of the bounds."""
    seen_K_per_s = trials.coupling_K_per_s
    is_within = seen_K_per_s <= bound_K_per_s
    claims = [
        Claim(
            "coupling seen",
            f"{trials.packs} packs charged, one of hot cells beside cold ones, stay within",
            is_within,
            bound_K_per_s,
            bound_K_per_s - seen_K_per_s,
            "K/s",
            "" if is_within else f"{seen_K_per_s:.3g} K/s were seen",
        ),
        Claim(
            "limits seen",
            "and no cell of theirs crosses a limit, each pack becomes full",
            trials.cells_over == 0 and trials.not_full == 0,
            0.0,
            float(-trials.cells_over),
            "cells over",
            ""
            if trials.cells_over == 0 and trials.not_full == 0
            else f"{trials.cells_over} cells over, {trials.not_full} packs not full",
        ),
    ]
    if trials.bare_surface_K is not None:
        least_K = trials.bare_surface_K
        claims.append(
            Claim(
                "no thermistor",
                "the bound on a surface without one is above that surface in all of them",
                least_K >= 0.0,
                0.0,
                least_K,
                "K",
                "" if least_K >= 0.0 else f"a surface was {-least_K:.3f} K above its bound",
            )
        )
    return claims


def _why(results: list[tuple[Certificate, CellCase]]) -> str:
    """Why the first cell that is not certified is not; nothing where all are."""
    for certificate, case in results:
        shortfall = certificate.shortfall
        if certificate.holds:
            continue
        cell, nominal = case.cell, case.preset.cell
        shares = (
            ("Rc", cell.core_resistance_K_per_W / nominal.core_resistance_K_per_W),
            ("Cc", cell.core_heat_capacity_J_per_K / nominal.core_heat_capacity_J_per_K),
            ("Rs", cell.surface_resistance_K_per_W / nominal.surface_resistance_K_per_W),
            ("R0", cell.ohmic_resistance_ohm / nominal.ohmic_resistance_ohm),
            ("capacity", cell.capacity_As / nominal.capacity_As),
        )
        which = ", ".join(f"{name} times {share:.3f}" for name, share in shares)
        lacks = ""
        if shortfall is not None and shortfall.missing > 0.0:
            lacks = f"lacks {shortfall.missing:.3g} and more"
        state = "" if shortfall is None else _at(shortfall.state)
        return f"the cell with {which} {lacks or 'is not certified'}{state}"
    return ""


def _at(state: Any) -> str:
    values = ", ".join(f"{name} {value:.6g}" for name, value in state.items())
    return f" at {values}" if values else ""
