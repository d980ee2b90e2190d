"""Everything that is wrong with a preset's file, each with its place, its cause and a remedy."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from bms.presets.agreement import disagreements
from bms.presets.authoring.firmware_limits import firmware_limits
from bms.presets.authoring.keys import CHANNELS, explanation, keys
from bms.presets.authoring.slips import likely_slips
from bms.presets.schema import Preset
from bms.validation import read_toml, refusals

_WITHOUT_UNIT = {"1", "text", "list of texts", "of the channel"}
_CELSIUS = (-60.0, 150.0)
_LIST_PLACE = re.compile(r"\.\d+")


@dataclass(frozen=True)
class Complaint:
    """A key by its dotted path, what is wrong there, and what to do about it."""

    key: str
    what: str
    remedy: str


def complaints(path: Path) -> list[Complaint]:
    """All complaints about a preset's file, in the order of the schema; empty if it is right.

    Raises InputError when the file is absent or no TOML.
    """
    content = read_toml(path)
    found = [*_empty(content), *_refused(content)]
    wrong = {_plain(complaint.key) for complaint in found}
    found += [one for one in _among_keys(content, wrong) if one not in found]
    if not found:
        value_of = _value_of(content, frozenset())
        # A slip of the unit is told rather than that the firmware takes no such number.
        slips = list(likely_slips(value_of)) or list(firmware_limits(value_of))
        found += [Complaint(*slip) for slip in slips]
    order = {key: number for number, key in enumerate(keys())}
    return sorted(found, key=lambda complaint: order.get(_plain(complaint.key), len(order)))


def _empty(content: Mapping[str, Any]) -> Iterator[Complaint]:
    for key in keys():
        values = [value for value in _values(content, key.split(".")) if _is_empty(value)]
        if values:
            yield Complaint(key, "is empty", _fill_in(key))


def _refused(content: Mapping[str, Any]) -> Iterator[Complaint]:
    for refusal in refusals(Preset, content):
        key, reason = refusal.key, refusal.reason
        # A reason that begins with a key is about this key, not about its table.
        if (named := re.match(r"([a-z_]+(?:\.\w+)+): (.*)", reason)) is not None:
            key, reason = named[1], named[2]
        plain = _plain(key)
        here = _values(content, plain.split("."))
        inside = [name for name in keys() if name.startswith(f"{plain}.")]
        if any(_is_empty(value) for value in here):
            continue
        if inside and any(
            _is_empty(value) for name in inside for value in _values(content, name.split("."))
        ):
            continue
        if refusal.is_missing:
            yield from (Complaint(name, "is missing", _fill_in(name)) for name in inside or [plain])
        elif refusal.is_unknown:
            yield Complaint(key, "no preset has such a key", _instead(plain))
        else:
            what = reason[:1].lower() + reason[1:]
            yield Complaint(key, _with_value(here, what), _likely(plain, here) + _mend(plain))


def _among_keys(content: Mapping[str, Any], wrong: set[str]) -> Iterator[Complaint]:
    for text in disagreements(_value_of(content, frozenset(wrong))):
        key, what = text.split(": ", 1)
        here = _values(content, key.split("."))
        yield Complaint(key, what, _likely(key, here) + _mend(key))


def _value_of(content: Mapping[str, Any], wrong: frozenset[str]) -> Any:
    """Values of keys that are numbers or lists of them, and not in `wrong`; None for others."""

    def value_of(key: str) -> Any:
        if key in wrong:
            return None
        found = _values(content, key.split("."))
        if len(found) != 1:
            return None
        numbers = found[0] if isinstance(found[0], list) else [found[0]]
        are_numbers = all(
            isinstance(number, (int, float)) and not isinstance(number, bool) for number in numbers
        )
        return found[0] if are_numbers and numbers else None

    return value_of


def _values(content: Any, path: list[str]) -> list[Any]:
    """What stands at a path, once for each table of a list."""
    if not path:
        return [content]
    if isinstance(content, list):
        return [value for each in content for value in _values(each, path)]
    if isinstance(content, dict) and path[0] in content:
        return _values(content[path[0]], path[1:])
    return []


def _is_empty(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_empty, value))
    return isinstance(value, str) and not value.strip()


def _plain(key: str) -> str:
    """The key without places in a list."""
    return _LIST_PLACE.sub("", key)


def _fill_in(key: str) -> str:
    told = explanation(key)
    if told is None:
        return "fill it in, see docs/presets.md"
    unit = "" if told.unit in _WITHOUT_UNIT else f" in {told.unit}"
    return f"fill it in{unit}: {told.what}; from: {told.where}"


def _mend(key: str) -> str:
    told = explanation(key)
    if told is None:
        return "see docs/presets.md"
    return f"{told.what} ({told.unit}); from: {told.where}"


def _likely(key: str, here: list[Any]) -> str:
    """The slip that a value looks like, as the beginning of a remedy."""
    numbers = here[0] if len(here) == 1 and isinstance(here[0], list) else here
    told = explanation(key)
    if told is None or not numbers or not all(isinstance(n, (int, float)) for n in numbers):
        return ""
    low, high = _CELSIUS
    if told.unit == "K" and all(low <= number <= high for number in numbers):
        kelvin = ", ".join(f"{number + 273.15:g}" for number in numbers)
        return f"in kelvin these are {kelvin}, if they are degC; "
    if key == "limits.reference_current_A" and numbers[0] > 0:
        return f"a charging current is negative: {-numbers[0]:g}; "
    if told.unit == "1" and max(numbers) > 1.0:
        return "a state of charge is 0 to 1, not per cent; " if "soc" in key else ""
    return ""


def _instead(key: str) -> str:
    table, _, name = key.rpartition(".")
    known = [one.rpartition(".")[2] for one in keys() if one.rpartition(".")[0] == table]
    names = known or list({one.split(".")[0] for one in keys() if "." in one} | set(CHANNELS))
    near = get_close_matches(name, names, n=1)
    return f"rename it to {near[0]}, or leave it out" if near else "leave it out"


def _with_value(here: list[Any], what: str) -> str:
    if len(here) == 1 and isinstance(here[0], (int, float, str)):
        return f"{here[0]!r}: {what}"
    return what
