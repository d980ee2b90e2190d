"""The firmware and its plant as a WebAssembly module: sources, and how they are compiled.

Imports no extension, so that it works before any is built.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from bms.errors import InputError
from bms.native_build import CORE_FOLDERS, CORE_HEADERS, ROOT

NATIVE = "hil_sim/dashboard/native"
_CHARGE = "hil_sim/studies/campaign/native"
_CELL = "hil_sim/native"
HEADERS = (
    *CORE_HEADERS,
    *(f"{_CELL}/{name}.h" for name in ("cell", "wire")),
    *(f"{_CHARGE}/{name}.h" for name in ("ecu_link", "baselines", "charge")),
    *(f"{NATIVE}/{name}.h" for name in ("normals", "session")),
)
"""What declares session_scenario_t, in order."""
_PACK = "hil_sim/studies/pack/native"
_PACK_PAGE = "hil_sim/dashboard/native_pack"
PACK_HEADERS = (
    *CORE_HEADERS,
    "firmware_c/pack/pack.h",
    f"{_CELL}/cell.h",
    *(f"{_PACK}/{name}.h" for name in ("plant", "pack_charge")),
    f"{NATIVE}/normals.h",
    f"{_PACK_PAGE}/pack_scenario.h",
)
"""What declares pack_scenario_t, in order."""
_FOLDERS = (*CORE_FOLDERS, _CELL, _CHARGE, NATIVE)
_FOR_A_HOST_ONLY = ("socketcan_batch.c",)
# As the extensions are compiled; a reactor has functions to call, and no start of its own.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-s")
_TARGET = ("-target", "wasm32-wasi", "-mexec-model=reactor")

_PACK_FOLDERS = (*CORE_FOLDERS, "firmware_c/pack", _CELL, _PACK, NATIVE, _PACK_PAGE)
_NOT_FOR_THE_PACK = tuple(
    f"{name}.{kind}" for name in ("page", "session", "pack_wire") for kind in "ch"
)
"""Of one cell, and of the bus, which the page has none of for a pack."""


def sources(root: Path = ROOT) -> list[Path]:
    """Everything that the modules are compiled from."""
    return sorted({*_sources(root, _FOLDERS), *_sources(root, _PACK_FOLDERS)})


def _sources(root: Path, folders: tuple[str, ...], without: tuple[str, ...] = ()) -> list[Path]:
    return [
        path
        for folder in folders
        for path in sorted((root / folder).glob("*.[ch]"))
        if path.name not in (*_FOR_A_HOST_ONLY, *without)
    ]


def compile_module(path: Path, root: Path = ROOT) -> None:
    """Write the module of a charge of one cell to a path; InputError as below."""
    _compile(path, root, _FOLDERS, _sources(root, _FOLDERS))


def compile_pack_module(path: Path, root: Path = ROOT) -> None:
    """Write the module of a pack to a path; InputError as below."""
    _compile(path, root, _PACK_FOLDERS, _sources(root, _PACK_FOLDERS, _NOT_FOR_THE_PACK))


def _compile(path: Path, root: Path, folders: tuple[str, ...], files: list[Path]) -> None:
    """Write a module to a path.

    Raises InputError without a compiler (ziglang from PyPI), or with what it complains of.
    """
    if find_spec("ziglang") is None:
        raise InputError(
            "no compiler for WebAssembly; get one with "
            "\"python -m pip install 'kan-rcbf-bms[dashboard-build]'\""
        )
    command = (
        *(sys.executable, "-m", "ziglang", "cc", *_TARGET, *_FLAGS),
        *(f"-I{folder}" for folder in folders),
        *(str(p.relative_to(root)) for p in files if p.suffix == ".c"),
        *("-o", str(path.resolve())),
    )
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"the module of the page cannot be compiled:\n{done.stderr.strip()}")
