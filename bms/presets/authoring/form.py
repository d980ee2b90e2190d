"""An empty preset: each key with what it is, its unit and where one finds its number."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bms.presets.authoring.keys import CHANNELS, Key, Table, explanation, explanations, tables

_WIDTH = 100
_USUAL = {
    "gains.alpha1_per_s": "0.05",
    "gains.alpha3_per_s2": "0.05",
    "gains.alpha4_per_s": "0.6",
    "gains.surface_condition": '"worst-case"',
    "timing.sampling_period_s": "0.1",
    "timing.delay_s": "0.1",
}
"""Choices of the controller's design, which no data sheet of a cell has."""
_HEAD = """
A preset to fill in: "" stands for a number or a text, [] for a list. Currents are negative while
charging, temperatures are in kelvin, state of charge is from 0 to 1. What stands behind a # may be
left out. 'bms preset check PRESET' says what is missing or wrong, and why.
"""


@dataclass(frozen=True)
class Known:
    """What a file tells of a key: the value, None where it tells none, and where from or why."""

    value: Any
    note: str


def form(name: str, known: Mapping[str, Known] | None = None) -> str:
    """TOML text to fill in for a cell of that name; only choices of the controller have a value.

    `known` has those of a file by their keys; their notes stand as comments.
    """
    known = known or {}
    lines = [*_comment(_HEAD)]
    for table in tables():
        if table.path.startswith("sensors."):
            continue
        lines += [""] if table.path else []
        lines += _section(table, name, known)
    return "\n".join(lines) + "\n"


def _section(table: Table, name: str, known: Mapping[str, Known]) -> Iterator[str]:
    if table.path:
        yield from _comment(explanations().table[table.path].what)
    is_told = any(key.path in known and known[key.path].value is not None for key in table.keys)
    mark = "# " if table.is_optional and not is_told else ""
    if table.path == "sensors":
        yield "[sensors]"
        yield from _sensors()
        return
    if table.path and not table.is_repeated:
        yield f"{mark}[{table.path}]"
    elif table.is_repeated:
        yield f"{mark}[[{table.path}]]"
    for key in table.keys:
        yield from _key(key, mark, name, known.get(key.path))


def _key(key: Key, mark: str, name: str, known: Known | None) -> Iterator[str]:
    told = explanation(key.path)
    if told is not None:
        unit = "" if key.is_text else f" Unit: {told.unit}."
        yield from _comment(f"{key.name}: {told.what}.{unit} From: {told.where}.")
    if known is not None and known.value is not None:
        note = f"  # {_printable(known.note)}" if known.note else ""
        yield f"{key.name} = {_printable(json.dumps(known.value, ensure_ascii=False))}{note}"
        return
    if known is not None:
        yield from _comment(_printable(known.note))
    is_left_out = key.is_optional and key.path not in _USUAL
    value = _USUAL.get(key.path, "[]" if key.is_list else '""')
    if key.path == "name":
        value = json.dumps(name, ensure_ascii=False)
    yield f"{mark or ('# ' if is_left_out else '')}{key.name} = {value}"


def _sensors() -> Iterator[str]:
    for name, key in explanations().key.items():
        if name.startswith("sensors."):
            yield from _comment(f"{name.split('.')[1]}: {key.what}. From: {key.where}.")
    for channel in CHANNELS:
        yield f'{channel} = {{ resolution = "", noise_std = "", bias = "" }}'


def _printable(text: str) -> str:
    """Without what TOML must not hold."""
    return "".join(one if one.isprintable() else "?" for one in text)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(
        " ".join(text.split()), _WIDTH, initial_indent="# ", subsequent_indent="#   ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
