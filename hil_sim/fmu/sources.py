"""The C sources that a unit is compiled from and carries with it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import files
from pathlib import Path

from bms.native_build import ROOT
from hil_sim.fmu.archive import described


def flat_sources(patterns: tuple[str, ...]) -> dict[str, bytes]:
    """Name -> content of C files of this project, whose names differ."""
    paths = [path for pattern in patterns for path in sorted(ROOT.glob(pattern))]
    sources = {path.name: path.read_bytes() for path in paths}
    assert len(sources) == len(paths), "two sources have one name"
    return sources


def source_folder(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """The sources by their paths in a unit."""
    return {f"sources/{name}": content for name, content in sources.items()}


def compiled_units(sources: Mapping[str, bytes]) -> list[str]:
    """Names of those that are compiled, in order."""
    return sorted(name for name in sources if name.endswith(".c"))


def build_description(identifier: str, sources: Mapping[str, bytes]) -> bytes:
    """How a unit of FMI 3.0 is built from its sources."""
    return described(
        "build_description.xml.j2", identifier=identifier, units=compiled_units(sources)
    )


def licence() -> bytes:
    """Text of the project's licence, from what is installed."""
    found = next(file for file in files("kan-rcbf-bms") or () if file.name == "LICENSE")
    return Path(str(found.locate())).read_bytes()
