"""An empty preset: each key with what it is, its unit and where one finds its number."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator

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


def form(name: str) -> str:
    """TOML text to fill in for a cell of that name; only choices of the controller have a value."""
    lines = [*_comment(_HEAD)]
    for table in tables():
        if table.path.startswith("sensors."):
            continue
        lines += [""] if table.path else []
        lines += _section(table, name)
    return "\n".join(lines) + "\n"


def _section(table: Table, name: str) -> Iterator[str]:
    if table.path:
        yield from _comment(explanations().table[table.path].what)
    mark = "# " if table.is_optional else ""
    if table.path == "sensors":
        yield "[sensors]"
        yield from _sensors()
        return
    if table.path and not table.is_repeated:
        yield f"{mark}[{table.path}]"
    elif table.is_repeated:
        yield f"{mark}[[{table.path}]]"
    for key in table.keys:
        yield from _key(key, mark, name)


def _key(key: Key, mark: str, name: str) -> Iterator[str]:
    told = explanation(key.path)
    if told is not None:
        unit = "" if key.is_text else f" Unit: {told.unit}."
        yield from _comment(f"{key.name}: {told.what}.{unit} From: {told.where}.")
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


def _comment(text: str) -> list[str]:
    return textwrap.wrap(
        " ".join(text.split()), _WIDTH, initial_indent="# ", subsequent_indent="#   ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
