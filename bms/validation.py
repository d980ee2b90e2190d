"""Reading of TOML and JSON files into dataclasses; every complaint names file, key and remedy."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any, TypeVar

from annotated_types import Ge, Gt, Lt
from pydantic import AllowInfNan, ConfigDict, TypeAdapter, ValidationError

from bms.errors import InputError

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
        # A TOML date is no JSON value; as text it is refused where a number is wanted.
        return TypeAdapter(kind).validate_json(json.dumps(content, allow_nan=True, default=str))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "content"
        reason = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{where}: {key}: {reason}") from None


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
