"""Reading of TOML and JSON files into dataclasses; every complaint names file, key and remedy."""

from __future__ import annotations

import json
import sys
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from annotated_types import Ge, Gt, Lt
from pydantic import AllowInfNan, ConfigDict, TypeAdapter, ValidationError

from bms.errors import InputError, ManyInputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Count = Annotated[int, Ge(1)]
Finite = Annotated[float, AllowInfNan(False)]
Positive = Annotated[float, Gt(0), AllowInfNan(False)]
NonNegative = Annotated[float, Ge(0), AllowInfNan(False)]
Negative = Annotated[float, Lt(0), AllowInfNan(False)]

T = TypeVar("T")


def strict(cls: type[T]) -> type[T]:
    """Class decorator: unknown keys are refused and text is never taken for a number."""
    cls.__pydantic_config__ = ConfigDict(extra="forbid", strict=True)  # type: ignore[attr-defined]
    return cls


def parse(kind: type[T], content: Any, where: str) -> T:
    """Object of a dataclass from decoded TOML or JSON; InputError names the first wrong key."""
    try:
        return _validated(kind, content)
    except ValidationError as error:
        first = _refusals(error)[0]
        raise InputError(f"{where}: {first.key}: {first.reason}") from None


@dataclass(frozen=True)
class Refusal:
    """Why a key, by its dotted path, was refused; `is_missing` and `is_unknown` tell of a key."""

    key: str
    reason: str
    is_missing: bool
    is_unknown: bool


def refusals(kind: type[T], content: Any) -> list[Refusal]:
    """All that keeps decoded TOML or JSON from being an object of a dataclass; empty if nothing.

    What keys have to be among each other is seen only where each for itself is right.
    """
    try:
        _validated(kind, content)
    except ValidationError as error:
        return _refusals(error)
    return []


def _validated(kind: type[T], content: Any) -> T:
    # A TOML date is no JSON value; as text it is refused where a number is wanted.
    adapter: TypeAdapter[T] = _adapter(cast("Hashable", kind))
    return adapter.validate_json(json.dumps(content, allow_nan=True, default=str))


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    """Made once: for the faults of a run that takes longer than all else of their reading."""
    return TypeAdapter(kind)


def _refusals(error: ValidationError) -> list[Refusal]:
    found = []
    for one in error.errors(include_url=False):
        key = ".".join(str(part) for part in one["loc"]) or "content"
        cause = one.get("ctx", {}).get("error")
        reasons = cause.complaints if isinstance(cause, ManyInputError) else (one["msg"],)
        found += [
            Refusal(
                key,
                reason.removeprefix("Value error, "),
                one["type"] in {"missing", "missing_argument"},
                one["type"] in {"extra_forbidden", "unexpected_keyword_argument"},
            )
            for reason in reasons
        ]
    return found


def read_text(path: Path) -> str:
    """Text of a file; InputError when it is absent or not text."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); give a readable text file") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Decoded TOML; InputError names file and line of a syntax error."""
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # numbers too long, nesting too deep as well
        raise InputError(f"{path}: not valid TOML: {error}; mend the file") from None


def read_json(path: Path) -> Any:
    """Decoded JSON; InputError names file and line of a syntax error."""
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:  # a number too long, nesting too deep
        raise InputError(f"{path}: not valid JSON: {error}; mend the file") from None
