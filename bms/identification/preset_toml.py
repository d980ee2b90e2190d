"""A preset as TOML text."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

from bms.presets import Preset


def preset_toml(preset: Preset) -> str:
    """TOML text that load_preset reads as the same preset; absent optional values are left out."""
    lines = []
    content = dataclasses.asdict(preset)
    lines += [f"{key} = {_value(value)}" for key, value in content.items() if _is_plain(value)]
    lines += _sections(content, ())
    return "\n".join(lines) + "\n"


def _sections(content: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    lines = []
    for name, section in content.items():
        if isinstance(section, dict):
            here = (*path, name)
            lines += ["", f"[{'.'.join(here)}]"]
            lines += [f"{key} = {_value(v)}" for key, v in section.items() if _is_plain(v)]
            lines += _sections(section, here)
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
