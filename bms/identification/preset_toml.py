"""A preset as TOML text."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

from bms.presets import Preset


def preset_toml(preset: Preset, notes: Mapping[str, str] | None = None) -> str:
    """TOML text that load_preset reads as the same preset; absent optional values are left out.

    `notes` by key, such as cell.capacity_Ah, stand as comments behind their numbers, those of a
    table behind its heading.
    """
    lines = []
    content = dataclasses.asdict(preset)
    lines += [f"{key} = {_value(value)}" for key, value in content.items() if _is_plain(value)]
    lines += _sections(content, (), notes or {})
    return "\n".join(lines) + "\n"


def _noted(line: str, path: tuple[str, ...], notes: Mapping[str, str]) -> str:
    note = notes.get(".".join(path))
    return line if note is None else f"{line}  # {note}"


def _sections(
    content: Mapping[str, Any], path: tuple[str, ...], notes: Mapping[str, str]
) -> list[str]:
    lines = []
    for name, section in content.items():
        if isinstance(section, dict):
            here = (*path, name)
            lines += ["", _noted(f"[{'.'.join(here)}]", here, notes)]
            lines += [
                _noted(f"{key} = {_value(v)}", (*here, key), notes)
                for key, v in section.items()
                if _is_plain(v)
            ]
            lines += _sections(section, here, notes)
    return lines


def _is_plain(value: object) -> bool:
    return value is not None and not isinstance(value, dict)


def _value(value: object) -> str:
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, dict):
        pairs = (f"{key} = {_value(v)}" for key, v in value.items() if v is not None)
        return "{ " + ", ".join(pairs) + " }"
    # Strings of JSON are strings of TOML; repr of a float is a TOML float that reads back the same.
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
