"""The keys of a preset, as the schema has them, with what is to be known of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

from bms.presets.schema import Preset, Sensors
from bms.validation import parse, read_toml, strict

_EXPLANATIONS = Path(__file__).parent / "keys.toml"


@strict
@dataclass(frozen=True)
class Explanation:
    """Unit of a key, what it is and how to choose it, and where one finds its number."""

    unit: str
    what: str
    where: str


@strict
@dataclass(frozen=True)
class TableExplanation:
    """What a table of the file is for."""

    what: str


@strict
@dataclass(frozen=True)
class Explanations:
    """The file: of tables and of keys by their dotted path; the channels of sensors share keys."""

    table: dict[str, TableExplanation]
    key: dict[str, Explanation]


@dataclass(frozen=True)
class Key:
    """A key of the schema: dotted path, table of the file, and whether it may be left out.

    `is_list` tells that a file has a list there; `is_text` that it has words.
    """

    path: str
    table: str
    name: str
    is_optional: bool
    is_list: bool
    is_text: bool


@dataclass(frozen=True)
class Table:
    """A table of the file with its own keys, in the order of the schema.

    `is_repeated` tells of a list of such tables.
    """

    path: str
    is_optional: bool
    is_repeated: bool
    keys: tuple[Key, ...]


@cache
def explanations() -> Explanations:
    """What the package says of tables and keys."""
    return parse(Explanations, read_toml(_EXPLANATIONS), str(_EXPLANATIONS))


def explanation(path: str) -> Explanation | None:
    """Of a key by its dotted path, a channel of the sensors included; None for no such key."""
    parts = path.split(".")
    if parts[0] == "sensors" and len(parts) == 3:
        parts = [parts[0], parts[2]]
    return explanations().key.get(".".join(parts))


@cache
def tables() -> tuple[Table, ...]:
    """All tables of a preset, that of the plain keys, with the path "", first."""
    return tuple(_tables(Preset, "", is_optional=False, is_repeated=False))


@cache
def keys() -> Mapping[str, Key]:
    """All keys of a preset by their path."""
    return {key.path: key for table in tables() for key in table.keys}


def _tables(kind: Any, path: str, *, is_optional: bool, is_repeated: bool) -> Iterator[Table]:
    hints = get_type_hints(kind)
    plain, inner = [], []
    for field in dataclasses.fields(kind):
        here = f"{path}.{field.name}".strip(".")
        has_default = (
            field.default is not dataclasses.MISSING
            or field.default_factory is not dataclasses.MISSING
        )
        held = _dataclass_of(hints[field.name])
        if held is None:
            plain.append(
                Key(
                    here, path, field.name, has_default,
                    "tuple" in str(hints[field.name]), "str" in str(hints[field.name])
                    or "Literal" in str(hints[field.name]),
                )
            )  # fmt: skip
        else:
            is_list = "tuple" in str(hints[field.name])
            inner.append(
                _tables(held, here, is_optional=is_optional or has_default, is_repeated=is_list)
            )
    yield Table(path, is_optional, is_repeated, tuple(plain))
    for each in inner:
        yield from each


def _dataclass_of(hint: Any) -> Any:
    """The dataclass that a field holds: itself, optional, or a tuple of them; None for a value."""
    if dataclasses.is_dataclass(hint):
        return hint
    return next(filter(None, map(_dataclass_of, get_args(hint))), None)


CHANNELS = tuple(field.name for field in dataclasses.fields(Sensors))
