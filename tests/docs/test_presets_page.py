"""docs/presets.md is in step with the schema, and its example is a preset."""

import dataclasses
import re
import sys
from typing import get_args, get_type_hints

import pytest

from bms.barrier import sampling_margins
from bms.cell import OpenCircuitVoltage
from bms.presets import Preset, load_preset
from bms.presets.authoring.keys import explanations
from bms.presets.schema import Sensor, Sensors
from tests.docs.pages import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TEXT = (ROOT / "docs" / "presets.md").read_text(encoding="utf-8")
(EXAMPLE,) = re.findall(r"^```toml\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def inner_table(hint):
    """The dataclass that a key holds: itself, optional, or a list of them; None for a value."""
    if dataclasses.is_dataclass(hint):
        return hint
    return next(filter(None, map(inner_table, get_args(hint))), None)


def keys_of(kind, table=""):
    """Keys of the schema by the table of the file in which they stand."""
    hints = get_type_hints(kind)
    keys = {table: set()}
    for field in dataclasses.fields(kind):
        path = f"{table}.{field.name}".strip(".")
        inner = inner_table(hints[field.name])
        if inner is not None and kind is not Sensors:
            keys |= keys_of(inner, path)
        else:
            keys[table].add(field.name)
    return keys


def keys_on_the_page():
    """Keys in the first column of the tables, by the table of the file in their heading."""
    keys = {}
    for section in TEXT.split("\n## ")[1:]:
        found = set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE))
        heading = re.match(r"`\[([\w.]+)\]`", section)
        if found:
            keys[heading[1] if heading else ""] = found
    return keys


def test_every_key_of_the_schema_stands_on_the_page_and_no_other():
    schema = keys_of(Preset)
    channels = schema.pop("sensors")
    assert keys_on_the_page() == schema | {"sensors": {f.name for f in dataclasses.fields(Sensor)}}
    section = TEXT.split("## `[sensors]`")[1].split("\n| key")[0]
    assert set(re.findall(r"`(\w+_[AVKW])`", section)) == channels


def test_the_walk_over_the_schema_goes_to_its_leaves():
    assert keys_of(Preset)["cell.ocv"] == {f.name for f in dataclasses.fields(OpenCircuitVoltage)}


def test_each_key_has_its_unit_by_its_name():
    units = {"_V": "V", "_A": "A", "_K": "K", "_W": "W", "_s": "s", "_ohm": "ohm", "_Ah": "A h"} | {
        "_K_per_W": "K/W", "_J_per_K": "J/K", "_V_per_K": "V/K", "_A_per_s": "A/s",
        "_per_s": "1/s", "_per_s2": "1/s²", "_K_per_s": "K/s", "_K_per_s2": "K/s²",
        "_K_per_As": "K/s/A", "_K_per_A2s": "K/s/A²",
    }  # fmt: skip
    for key, unit in re.findall(r"^\| `(\w+)` \| ([^|]+) \|", TEXT, re.MULTILINE):
        endings = [ending for ending in units if f"_{key}".endswith(ending)]
        if endings:
            assert unit == units[max(endings, key=len)], key
        else:
            assert unit in {"1", "text", "list of texts", "of the channel"}, key


def in_words(text):
    """A cell of the page as the form has it: no marks, no links, no word on leaving it out."""
    text = re.sub(r" ?\(\[why\]\([^)]*\)\)", "", text).strip().replace("`", "").replace("**", "")
    text = text.replace("; 0 when left out", "")
    return re.sub(r";? ?may be left out(, and then the observer alone counts)?$", "", text)


def test_the_page_says_of_each_key_what_the_form_says():
    on_the_page = {}
    for section in TEXT.split("\n## ")[1:]:
        heading = re.match(r"`\[([\w.]+)\]`", section)
        table = heading[1] if heading else ""
        for row in re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \|", section, re.MULTILINE):
            on_the_page[f"{table}.{row[0]}".strip(".")] = (row[1], in_words(row[2]))
    assert on_the_page == {key: (told.unit, told.what) for key, told in explanations().key.items()}


def test_the_example_is_complete_and_loads(tmp_path):
    path = tmp_path / "my_cell.toml"
    path.write_text(EXAMPLE, encoding="utf-8")
    preset = load_preset(path)
    assert preset.name == "my_cell"
    assert preset.limits.reference_current_A == pytest.approx(-6 * preset.cell.capacity_Ah)
    assert preset.limits.max_core_temperature_K == 45.0 + 273.15
    assert sampling_margins(preset.cell, preset).surface_K_per_s2 > 0.0


def optional_keys(kind, table=""):
    """Keys that the schema lets a file leave out, and tables as a whole, by their paths."""
    hints = get_type_hints(kind)
    optional = set()
    for field in dataclasses.fields(kind):
        path = f"{table}.{field.name}".strip(".")
        has_default = field.default is not dataclasses.MISSING
        if has_default or field.default_factory is not dataclasses.MISSING:
            optional.add(path)
        inner = inner_table(hints[field.name])
        if inner is not None and kind is not Sensors:
            optional |= optional_keys(inner, path)
    return optional


def optional_on_the_page():
    """Paths of what the page says may be left out: in a key's line, or above a table's lines."""
    optional = set()
    for section in TEXT.split("\n## ")[1:]:
        heading = re.match(r"`\[([\w.]+)\]`", section)
        table = heading[1] if heading else ""
        above = section.split("\n| key")[0]
        if "may be left out" in above:
            optional.add(table)
        for key, line in re.findall(r"^\| `(\w+)` \|(.*)$", section, re.MULTILINE):
            if re.search("may be left out|leave it out", line) or "so may each key" in above:
                optional.add(f"{table}.{key}".strip("."))
    return optional


def test_what_may_be_left_out_is_what_the_page_says():
    assert optional_on_the_page() == optional_keys(Preset)


def test_all_that_the_example_leaves_out_is_optional():
    content, optional = tomllib.loads(EXAMPLE), optional_keys(Preset)
    for table, keys in keys_of(Preset).items():
        section = content
        for part in filter(None, table.split(".")):
            section = section.get(part, {})
        if section or table not in optional:
            missing = {f"{table}.{key}".strip(".") for key in keys - set(section)}
            assert missing <= optional


def test_the_example_is_the_published_cell():
    assert (
        tomllib.loads(EXAMPLE)["cell"]
        == tomllib.loads((ROOT / "bms" / "presets" / "lin2014.toml").read_text(encoding="utf-8"))[
            "cell"
        ]
    )
