"""BPX files (Battery Parameter eXchange): read, held against the standard by its own package."""

from __future__ import annotations

import json
import math
import re
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from bms.errors import InputError
from bms.identification.bpx.function import values
from bms.validation import read_json, read_text

ELECTRODES = ("Negative electrode", "Positive electrode")
OCP, ENTROPY = "OCP [V]", "Entropic change coefficient [V.K-1]"
CONDUCTIVITY = "Thermal conductivity [W.m-1.K-1]"
_TEMPERATURE = "Initial temperature [K]"
_INSTALL = "pip install 'kan-rcbf-bms[bpx]'"
_IS_BPX = "give a BPX file: JSON or YAML with Header and Parameterisation"


@dataclass(frozen=True)
class BpxFile:
    """A file that keeps the standard: its name, version and tables by the standard's own names."""

    path: Path
    version: str
    header: Mapping[str, Any]
    parameterisation: Mapping[str, Any]
    state: Mapping[str, Any]

    def number(self, *place: str) -> float | None:
        """Number at a place below Parameterisation, or below State; None where there is none."""
        here: Any = self.state if place[0] == "State" else self.parameterisation
        for name in place[1:] if place[0] == "State" else place:
            here = here.get(name) if isinstance(here, Mapping) else None
        return float(here) if isinstance(here, (int, float)) else None

    def has(self, *place: str) -> bool:
        """Whether there is a number at a place."""
        return self.number(*place) is not None

    def source(self, *place: str) -> str:
        """Where a number comes from, in words."""
        return f"BPX file {self.path.name}, {': '.join(place)}"


def read_bpx(path: Path) -> BpxFile:
    """Read a BPX file of version 0.x or 1.x; InputError tells in one line what is wrong."""
    bpx = _package("bpx")
    content = _content(path)
    written = _version(path, content)
    if _numbers(written)[:2] > _numbers(bpx.__version__)[:2]:
        raise InputError(
            f"{path}: Header: BPX: version {written} is newer than the package bpx "
            f"{bpx.__version__}; install a newer one, or have the file written in "
            f"{'.'.join(bpx.__version__.split('.')[:2])}"
        )
    if not isinstance(content["Parameterisation"].get("Cell"), dict):
        raise InputError(f"{path}: Parameterisation: Cell: is missing; give a file with a cell")
    _refuse_what_is_not_finite(path, content)
    _refuse_other_functions(path, content["Parameterisation"])
    checked = _checked(path, bpx, content)
    parameterisation, state = dict(checked["Parameterisation"]), dict(checked.get("State", {}))
    if _numbers(written)[0] == 0:
        # The package's conversion drops the one and makes up the other where the file has none.
        old = content["Parameterisation"]["Cell"]
        parameterisation["Cell"] = parameterisation["Cell"] | _only(old, CONDUCTIVITY)
        state = {"Initial conditions": _only(old, _TEMPERATURE)}
    return BpxFile(path, written, checked["Header"], parameterisation, state)


def _only(section: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {name: section[name]} if name in section else {}


def _package(name: str) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(name)
    except ImportError:
        raise InputError(f"--from-bpx: {name} is not installed; {_INSTALL}") from None


def _content(path: Path) -> dict[str, Any]:
    if path.suffix in {".yml", ".yaml"}:
        yaml = _package("yaml")
        try:
            # By way of JSON, which has neither dates nor circles.
            content = json.loads(json.dumps(yaml.safe_load(read_text(path)), default=str))
        except (yaml.YAMLError, TypeError, ValueError, RecursionError):
            raise InputError(f"{path}: not valid YAML; {_IS_BPX}") from None
    else:
        content = read_json(path)
    parts = ("Header", "Parameterisation")
    if not isinstance(content, dict) or not all(
        isinstance(content.get(part), dict) for part in parts
    ):
        raise InputError(f"{path}: no BPX file; {_IS_BPX}")
    return content


def _version(path: Path, content: Mapping[str, Any]) -> str:
    version = content["Header"].get("BPX")
    text = f"{version:.1f}" if isinstance(version, float) else str(version)
    if re.fullmatch(r"\d{1,4}(\.\d{1,4}){1,2}", text) is None:
        raise InputError(f"{path}: Header: BPX: is no version such as 1.1.0; {_IS_BPX}")
    return text


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version)[:3]))


def _refuse_what_is_not_finite(path: Path, content: Mapping[str, Any]) -> None:
    for place, value in _leaves(content, ()):
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(
                f"{path}: {': '.join(place)}: {value} is no number; write it, or leave it out"
            )


def _leaves(value: Any, place: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*place, str(name)))
    elif isinstance(value, list):
        for inner in value:
            yield from _leaves(inner, place)
    else:
        yield place, value


def _refuse_other_functions(path: Path, content: Mapping[str, Any]) -> None:
    """Before the package sees them: it runs the text of an electrode's potential as Python."""
    for place, value in _leaves(content, ("Parameterisation",)):
        if isinstance(value, str) and place[-1].startswith("OCP"):
            try:
                values(value, np.array([0.5]))
            except ValueError as error:
                raise InputError(f"{path}: {': '.join(place)}: {error}; mend the file") from None


def _checked(path: Path, bpx: Any, content: dict[str, Any]) -> Any:
    """The content as the package gives it back; it warns of what `bms preset check` tells too."""
    try:
        with _own_temporary_files(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            checked = bpx.parse_bpx_obj(content)
            return checked.model_dump(by_alias=True, exclude_none=True)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, ArithmeticError) as e:
        raise InputError(f"{path}: {_reason(e)}; mend the file by the BPX standard") from None


def _reason(error: Exception) -> str:
    if not hasattr(error, "errors"):
        return " ".join(str(error).split()) or type(error).__name__
    first = error.errors()[0]
    place = ": ".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}".removeprefix(": ")


@contextmanager
def _own_temporary_files() -> Iterator[None]:
    """The package leaves a file for each function that it tries; here they go with their folder."""
    before = tempfile.tempdir
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder
        try:
            yield
        finally:
            tempfile.tempdir = before
