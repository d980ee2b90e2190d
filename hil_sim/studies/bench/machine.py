"""The machine that a benchmark ran on, and versions of packages."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from bms import __version__

THIS_PROJECT = f"kan-rcbf-bms {__version__}"


@dataclass(frozen=True)
class Machine:
    """Processor, its number of cores, interpreter, and the load of one minute."""

    cpu: str
    cores: int
    system: str
    python: str
    load_average: float


def this_machine() -> Machine:
    """The machine as it is now."""
    return Machine(
        cpu=_cpu(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        load_average=round(os.getloadavg()[0], 2),
    )


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


@contextmanager
def one_core() -> Iterator[int | None]:
    """Keep this process on the last of its cores meanwhile; yields the number of that core.

    None where the system has no such thing.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield None
        return
    before = os.sched_getaffinity(0)
    core = max(before)
    os.sched_setaffinity(0, {core})
    try:
        yield core
    finally:
        os.sched_setaffinity(0, before)


def package(name: str) -> str:
    """Name of an installed package with its version; ImportError when it is not installed."""
    return f"{name} {version(name)}"
