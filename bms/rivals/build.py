"""Builds bms.rivals._rivals: the other estimators in C behind cffi (API mode), for a host only.

Flags and the reading of headers are those of bms/firmware/build.py, which is loaded by path because
its package needs an extension that is not built yet.
"""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from cffi import FFI

ROOT = Path(__file__).resolve().parents[2]
NATIVE = Path("bms/rivals/native")
MODULE = "bms.rivals._rivals"
HEADERS = ("linear", "mlp", "thermal", "covariance", "kalman", "rows")


def make_builder() -> FFI:
    """Builder of the extension, with paths relative to the repository as setuptools wants them."""
    firmware: dict[str, Any] = runpy.run_path(str(ROOT / "bms/firmware/build.py"), run_name="build")
    builder = FFI()
    for name in HEADERS:
        builder.cdef(firmware["declarations"](ROOT / NATIVE / f"{name}.h"))
    builder.set_source(
        MODULE,
        '#include "rows.h"',
        sources=[str(path.relative_to(ROOT)) for path in sorted((ROOT / NATIVE).glob("*.c"))],
        include_dirs=[str(NATIVE)],
        libraries=["m"],
        extra_compile_args=list(firmware["FLAGS"]),
    )
    return builder


ffibuilder = make_builder()
