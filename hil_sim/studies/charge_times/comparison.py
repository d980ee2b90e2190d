"""Bounds and charges of every start, on several processes, and what they come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, TypeVar

from bms.studies.optimum.answer import stated_s
from bms.studies.optimum.bound import lower_bound
from hil_sim.run.workforce import Workforce
from hil_sim.studies.charge_times.controllers import RIVALS, Played, play
from hil_sim.studies.charge_times.starts import Start

T = TypeVar("T")
R = TypeVar("R")
LIMITS = ("core", "surface", "voltage", "soc")
BOUNDS = ("optimum_time_s", "lower_bound_s")
"""By physics alone, and with ramp and map: the names that `bms sil` has for them."""


@dataclass(frozen=True)
class Compared:
    """A start with both bounds in s, and the charges of the controllers from it."""

    start: Start
    optimum_time_s: float
    lower_bound_s: float
    played: tuple[Played, ...]

    def ratio(self, played: Played, bound: str) -> float | None:
        """Time to full over one of BOUNDS; None where the cell did not become full."""
        bound_s: float = getattr(self, bound)
        return None if played.charge_time_s is None else played.charge_time_s / bound_s


def compare(start: Start, controllers: Sequence[str] = tuple(RIVALS)) -> Compared:
    """Bounds and charges of one start. Raises InputError without cvxpy."""
    charge, preset = start.charge(), start.loaded()
    optimum_s = stated_s(lower_bound(charge.physics_alone()))
    bound_s = stated_s(lower_bound(charge))
    charges = tuple(play(name, preset, bound_s) for name in controllers)
    return Compared(start, optimum_s, bound_s, charges)


def on_workforce(
    work: Callable[[T], R], pieces: Sequence[T], force: Workforce, told: Callable[[], None]
) -> list[R]:
    """Results in the order of the pieces; `told` hears of each that is done.

    Raises what the work does; who made the workforce tells of a process that dies.
    """
    futures = {force.executor.submit(work, piece): number for number, piece in enumerate(pieces)}
    results: dict[int, R] = {}
    try:
        for future in as_completed(futures):
            results[futures[future]] = future.result()
            told()
    finally:
        for future in futures:
            future.cancel()
    return [results[number] for number in range(len(pieces))]


def summed_up(rows: Sequence[Compared], controller: str) -> dict[str, Any]:
    """Median and worst of a controller over both bounds, and what it crossed.

    A charge that did not become full counts as infinitely long in the median; then the worst is
    None, and the median too where it is such a charge.
    """
    pairs = [(row, one) for row in rows for one in row.played if one.controller == controller]
    figures: dict[str, Any] = {
        "full": sum(one.charge_time_s is not None for _, one in pairs),
        "charges": len(pairs),
    }
    for bound in BOUNDS:
        ratios = [row.ratio(one, bound) or float("inf") for row, one in pairs]
        figures[f"over_{bound}"] = {
            "median": _finite(median(ratios)),
            "worst": _finite(max(ratios)),
        }
    figures["crossed"] = {
        limit: {
            "charges": sum(limit in one.crossed for _, one in pairs),
            "most": max((one.crossed.get(limit, 0.0) for _, one in pairs), default=0.0),
        }
        for limit in LIMITS
    }
    figures["crossing_charges"] = sum(bool(one.crossed) for _, one in pairs)
    for name in ("max_core_temperature_K", "mean_core_temperature_K", "heat_J"):
        figures[f"median_{name}"] = median(getattr(one, name) for _, one in pairs)
    return figures


def certified_are_safe(rows: Sequence[Compared]) -> bool:
    """Whether no controller that claims to keep limits crossed one, and each filled its cell."""
    return all(
        not one.crossed and one.charge_time_s is not None
        for row in rows
        for one in row.played
        if RIVALS[one.controller].is_certified
    )


def content_json(rows: Sequence[Compared]) -> dict[str, Any]:
    """Plain mapping of everything, the same on every machine with the same arithmetic."""
    names = list(dict.fromkeys(one.controller for row in rows for one in row.played))
    return {
        "starts": [
            asdict(row.start)
            | {bound: getattr(row, bound) for bound in BOUNDS}
            | {"charges": [_charge_json(row, one) for one in row.played]}
            for row in rows
        ],
        "controllers": {
            name: {"title": RIVALS[name].title, "is_certified": RIVALS[name].is_certified}
            | summed_up(rows, name)
            for name in names
        },
        "passed": certified_are_safe(rows),
    }


def _charge_json(row: Compared, one: Played) -> dict[str, Any]:
    ratios = {f"over_{bound}": row.ratio(one, bound) for bound in BOUNDS}
    content = asdict(one) | ratios
    return {
        key: round(value, 6) if isinstance(value, float) else value
        for key, value in content.items()
    }


def _finite(value: float) -> float | None:
    return round(value, 4) if value < float("inf") else None
