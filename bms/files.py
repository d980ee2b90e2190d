"""Writing of single files, at once or not at all, and the folders that they go to."""

from __future__ import annotations

import io
import os
import tempfile
from pathlib import Path
from typing import Any, Protocol

from bms.errors import InputError


def make_folder(path: Path) -> None:
    """Make a folder and its parents unless it is there; InputError when that cannot be done."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be made ({error.strerror}); choose another folder"
        ) from None


class Drawn(Protocol):
    """What writes itself as a picture, such as matplotlib's Figure."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write it to a file."""


def png(figure: Drawn, dpi: int) -> bytes:
    """The figure as PNG, the same bytes on each run with the same matplotlib."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def write_text(path: Path, text: str) -> None:
    """Write the file in UTF-8; InputError when that cannot be done."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write the file under another name and rename it; InputError when that cannot be done."""
    temporary: str | None = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); choose a folder that can"
        ) from None
