"""Templates, C literals and the safe writing of generated files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from bms.errors import InputError

_INDENT = "    "
_NUMBERS_PER_LINE = 4


def environment() -> jinja2.Environment:
    """Jinja environment over codegen/templates; an undefined name is an error."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("codegen"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def float_literal(value: float) -> str:
    """C99 literal that reads back as exactly the nearest float32; InputError beyond its range."""
    with np.errstate(over="ignore"):
        single = np.float32(value)
    if not np.isfinite(single):
        raise InputError(f"number {value}: does not fit into float32")
    digits = f"{float(single):.9g}"
    return f"{digits}f" if "." in digits or "e" in digits else f"{digits}.0f"


def initialiser(value: Any, depth: int = 0) -> str:
    """C initialiser of nested mappings (designated), lists and numbers."""
    inner = _INDENT * (depth + 1)
    if isinstance(value, Mapping):
        parts = [f"{inner}.{name} = {initialiser(v, depth + 1)},\n" for name, v in value.items()]
        return "{\n" + "".join(parts) + _INDENT * depth + "}"
    if isinstance(value, list | tuple):
        if all(isinstance(item, Mapping) for item in value):
            rows = [f"{inner}{initialiser(item, depth + 1)},\n" for item in value]
            return "{\n" + "".join(rows) + _INDENT * depth + "}"
        numbers = [initialiser(item) for item in value]
        lines = [
            inner + ", ".join(numbers[i : i + _NUMBERS_PER_LINE]) + ",\n"
            for i in range(0, len(numbers), _NUMBERS_PER_LINE)
        ]
        return "{\n" + "".join(lines) + _INDENT * depth + "}"
    return f"{value}u" if isinstance(value, int) else float_literal(value)


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write all files or none: they are completed under other names first and then renamed.

    Names are paths in the folder; the folders in between are created. Raises InputError when a
    folder cannot be written, or a folder stands where a file has to go.
    """
    for target in (folder / name for name in contents):
        if target.is_dir():
            raise InputError(f"{target}: is a folder; choose another one for the files")
    created: list[Path] = []
    staged: list[tuple[Path, Path]] = []
    try:
        for name, content in contents.items():
            target = folder / name
            for path in _missing_folders(target.parent):
                path.mkdir()
                created.append(path)
            handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
            staged.append((Path(temporary), target))
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
        for source, target in staged:
            source.chmod(0o644)
            source.replace(target)
    except OSError as error:
        for source, _ in staged:
            source.unlink(missing_ok=True)
        for path in reversed(created):
            with suppress(OSError):  # what others have put there meanwhile stays
                path.rmdir()
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}); choose a folder that can"
        ) from None
    return [target for _, target in staged]


def _missing_folders(folder: Path) -> list[Path]:
    """The folder and those that it lies in, as far as they are missing, the outermost first."""
    return [path for path in (*reversed(folder.parents), folder) if not path.exists()]
