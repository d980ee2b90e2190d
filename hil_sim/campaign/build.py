"""Builds hil_sim.campaign._runner: closed-loop charges in C, around the firmware's own sources.

For the host only. Flags and the reading of headers are those of bms/firmware/build.py, which is
loaded by path because its package needs an extension that is not built yet.
"""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from cffi import FFI

ROOT = Path(__file__).resolve().parents[2]
NATIVE = Path("hil_sim/campaign/native")
MODULE = "hil_sim.campaign._runner"
HEADERS = ("cell", "ecu_link", "baselines", "charge")


def make_builder() -> FFI:
    """Builder of the extension, with paths relative to the repository as setuptools wants them."""
    firmware: dict[str, Any] = runpy.run_path(str(ROOT / "bms/firmware/build.py"), run_name="build")
    folder: Path = firmware["FIRMWARE"]
    builder = FFI()
    headers = [ROOT / folder / "include" / f"{name}.h" for name in firmware["HEADERS"]]
    headers += [ROOT / NATIVE / f"{name}.h" for name in HEADERS]
    builder.cdef("\n".join(firmware["declarations"](header) for header in headers))
    includes = [folder / name for name in ("include", "src", "generated")] + [NATIVE]
    sources = [path for include in includes for path in sorted((ROOT / include).glob("*.c"))]
    builder.set_source(
        MODULE,
        '#include "charge.h"',
        sources=[str(path.relative_to(ROOT)) for path in sources],
        include_dirs=[str(include) for include in includes],
        extra_compile_args=list(firmware["FLAGS"]),
    )
    return builder


ffibuilder = make_builder()
