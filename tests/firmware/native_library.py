"""Parts of the firmware as a shared library, with the declarations of their own headers.

Quicker than the extension, so that a part can be broken on purpose and tried at once.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cffi import FFI

from bms.native_build import FLAGS, SANITIZERS, declarations

FIRMWARE = Path(__file__).parents[2] / "firmware_c"
VARIANT = "BMS_SOURCE_VARIANT"
"""Environment variable with the path of a changed source, which stands for the one of its name."""
SANITIZE = "BMS_SANITIZE"
"""Environment variable with which libraries are built with the sanitizers, too."""
FOLDERS = ("include", "src", "generated", "image", "boot", "port")


def load_library(
    out: Path,
    sources: Sequence[Path],
    headers: Sequence[str],
    change: tuple[str, str, str] | None = None,
    extra: str = "",
    flags: Sequence[str] = (),
) -> tuple[FFI, Any]:
    """Declarations and library of sources; headers are paths in firmware_c, in order.

    `change` replaces a text in the source of that name by another one; `extra` declares more;
    `flags` are for the compiler.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = [_changed(source, out, change) for source in sources]
    library = out / "library.so"
    includes = [f"-I{FIRMWARE / folder}" for folder in FOLDERS]
    compiler = os.environ.get("CC", "gcc")
    sanitizers = SANITIZERS if os.environ.get(SANITIZE) else ()
    command = [compiler, *FLAGS, "-O0", "-fPIC", "-shared", *sanitizers, *flags, *includes]
    command += [*map(str, files), "-lm"]
    subprocess.run([*command, "-o", str(library)], check=True)
    ffi = FFI()
    ffi.cdef("\n".join([*(declarations(FIRMWARE / header) for header in headers), extra]))
    return ffi, ffi.dlopen(str(library))


def _changed(source: Path, out: Path, change: tuple[str, str, str] | None) -> Path:
    variant = Path(os.environ.get(VARIANT, ""))
    if source.name == variant.name:
        source = variant
    if change is None or source.name != change[0]:
        return source
    text = source.read_text(encoding="utf-8")
    assert change[1] in text, "the change no longer applies; bring it up to date"
    target = out / source.name
    target.write_text(text.replace(change[1], change[2]), encoding="utf-8")
    return target
