"""Which cell each thermistor of a pack sits on, from a TOML file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bms.errors import InputError
from bms.validation import parse, read_toml, strict


@strict
@dataclass(frozen=True)
class _Pack:
    thermistor_at: tuple[int, ...]


@strict
@dataclass(frozen=True)
class _File:
    pack: _Pack


def thermistor_map(path: Path | None, cells: int, per_thermistor: int) -> tuple[int, ...] | None:
    """What --thermistors says beside --per-thermistor; None without it.

    Raises InputError as load_thermistor_map does, and where both are given.
    """
    if path is None:
        return None
    if per_thermistor != 1:
        raise InputError("--per-thermistor: --thermistors says where they are; give one of both")
    return load_thermistor_map(path, cells)


def load_thermistor_map(path: Path, cells: int) -> tuple[int, ...]:
    """Cell of each thermistor, from 0 on, in the order in which they are sent.

    The file has cells from 1 on: `[pack]`, `thermistor_at = [3, 8, 14]`. Raises InputError in one
    line for what no pack of so many cells has.
    """
    named = parse(_File, read_toml(path), str(path)).pack.thermistor_at
    where = f"{path}: pack.thermistor_at"
    if not named:
        raise InputError(f"{where}: no cell; name one at least")
    for cell in named:
        if not 1 <= cell <= cells:
            raise InputError(f"{where}: cell {cell}: the pack has cells 1 to {cells}; name those")
        if named.count(cell) > 1:
            raise InputError(f"{where}: cell {cell} is named twice; a cell has one thermistor")
    return tuple(cell - 1 for cell in named)
