"""Replacing numbers in the text of a preset, so that comments and order stay."""

from __future__ import annotations

import re
from collections.abc import Mapping

from bms.errors import InputError


def with_values(text: str, values: Mapping[tuple[str, str], float]) -> str:
    """TOML text with the values at (section, key) replaced.

    Raises InputError when the text lacks one of them.
    """
    missing = dict(values)
    section, lines = "", []
    for line in text.splitlines():
        if heading := re.fullmatch(r"\[([\w.]+)\]", line.strip()):
            section = heading[1]
        key = line.partition("=")[0].strip()
        value = missing.pop((section, key), None)
        lines.append(line if value is None else f"{key} = {value!r}")
    if missing:
        section, key = next(iter(missing))
        raise InputError(f"preset: no line '{key} = ...' in [{section}]; add it")
    return "\n".join(lines) + "\n"
