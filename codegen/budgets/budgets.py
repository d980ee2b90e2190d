"""Limits and figures: what a target may need, what it needed last, what it needs now."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bms.errors import InputError
from bms.files import write_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@dataclass(frozen=True)
class Figures:
    """Bytes of flash, RAM and worst stack; None where a figure makes no sense."""

    flash: int | None = None
    ram: int | None = None
    stack: int | None = None


@dataclass(frozen=True)
class Budget:
    """What firmware_c/budgets.toml says of one target."""

    limits: Mapping[str, int]
    exception_frame: int
    indirect_calls: Mapping[str, list[str]]


def load_budget(path: Path, target: str) -> Budget:
    """Budget of a target; InputError when the file has none."""
    data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    try:
        return Budget(
            data["limits"][target], data["exception_frames"][target], data["indirect_calls"]
        )
    except KeyError as missing:
        raise InputError(f"{path}: no {missing} for target {target}; add it") from None


def exceeded(figures: Mapping[str, Figures], limits: Mapping[str, int]) -> list[str]:
    """One line for each limit that is exceeded. Limits are named row_figure, rows as in figures."""
    lines = []
    for name, limit in limits.items():
        row, _, figure = name.rpartition("_")
        used = getattr(figures[row or "image"], figure)
        if used > limit:
            lines.append(f"{name}: {used} bytes, {used - limit} more than the {limit} allowed")
    return lines


def load_figures(path: Path, target: str) -> dict[str, Figures]:
    """Figures of a target as last accepted, by row; empty when there are none."""
    if not path.exists():
        return {}
    accepted = json.loads(path.read_text(encoding="utf-8"))
    return {row: Figures(**figures) for row, figures in accepted.get(target, {}).items()}


def save_figures(path: Path, target: str, figures: Mapping[str, Figures]) -> None:
    """Accept the figures of a target, beside those of the others."""
    accepted = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    accepted[target] = {row: asdict(figures[row]) for row in figures}
    write_text(path, json.dumps(accepted, indent=2, sort_keys=True) + "\n")


def table(figures: Mapping[str, Figures], accepted: Mapping[str, Figures]) -> str:
    """Rows of figures in bytes, each with its difference to the accepted one."""
    width = max(map(len, figures))
    lines = [f"{'bytes':{width}}{'flash':>16}{'RAM':>16}{'stack':>16}"]
    for row, now in figures.items():
        before = accepted.get(row, Figures())
        cells = [
            _cell(getattr(now, name), getattr(before, name)) for name in ("flash", "ram", "stack")
        ]
        lines.append(f"{row:{width}}{''.join(cells)}".rstrip())
    return "\n".join(lines)


def _cell(now: int | None, before: int | None) -> str:
    if now is None:
        return " " * 16
    change = "new" if before is None else f"{now - before:+d}" if now != before else ""
    return f"{now:>9}{change:>7}"
