"""Templates, C literals and the safe writing of generated files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
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

    Raises InputError when the folder cannot be written, or a folder stands where a file has to go.
    """
    for target in (folder / name for name in contents):
        if target.is_dir():
            raise InputError(f"{target}: is a folder; choose another one for the files")
    staged: list[tuple[Path, Path]] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".{name}.")
            staged.append((Path(temporary), folder / name))
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
        for source, target in staged:
            source.chmod(0o644)
            source.replace(target)
    except OSError as error:
        for source, _ in staged:
            source.unlink(missing_ok=True)
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}); choose a folder that can"
        ) from None
    return [target for _, target in staged]
