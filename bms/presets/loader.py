"""Finding and reading presets by name or path."""

from __future__ import annotations

from pathlib import Path

from bms.errors import InputError
from bms.presets.schema import Preset
from bms.validation import parse, read_toml

DEFAULT_PRESET = "paper_calibrated"
_FOLDER = Path(__file__).parent


def preset_names() -> list[str]:
    """Names of the presets that ship with the package, sorted."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def one_cell_preset_names() -> list[str]:
    """Names of the shipped presets that describe one cell, not a family; sorted."""
    return [name for name in preset_names() if load_preset(name).cell.interval is None]


def preset_path(name_or_path: str | Path) -> Path:
    """File of a preset, by shipped name or by path of a TOML file.

    Raises InputError for a name that does not ship.
    """
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return path
    names = preset_names()
    if str(name_or_path) not in names:
        raise InputError(
            f"preset '{name_or_path}': unknown; choose one of {', '.join(names)} "
            "or give the path of a .toml file"
        )
    return _FOLDER / f"{name_or_path}.toml"


def load_preset(name_or_path: str | Path) -> Preset:
    """Preset by shipped name or by path of a TOML file.

    Raises InputError that names the file, the key and what is wrong with it.
    """
    path = preset_path(name_or_path)
    return parse(Preset, read_toml(path), str(path))
