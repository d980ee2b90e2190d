"""Compiles the sources of a unit to the library in it, by the C compiler of this machine."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.errors import InputError
from bms.native_build import FLAGS

LIBRARY_FLAGS = (*FLAGS, "-fPIC", "-fvisibility=hidden", "-shared")
# Neither paths nor times of this machine, so that the same sources give the same bytes.
_LINKER_FLAGS = ("-s", "-Wl,--build-id=none", "-Wl,--no-undefined")
_SOURCES_REMEDY = "the folder sources/ of a unit made elsewhere builds it for another platform"


def compile_library(sources: Mapping[str, bytes]) -> bytes:
    """Shared library of flat C sources for Linux on x86-64.

    The compiler is that of the environment's CC, else cc. Raises InputError on another platform,
    without a compiler, and with what the compiler says when it fails.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise InputError(
            f"a unit is built for x86_64-linux, and this is {platform.machine()} on "
            f"{sys.platform}; build it on such a machine: {_SOURCES_REMEDY}"
        )
    command = shlex.split(os.environ.get("CC", "cc")) or ["cc"]
    if shutil.which(command[0]) is None:
        raise InputError(
            f"no C compiler '{command[0]}' is there, and a unit is compiled; install one "
            "('apt-get install gcc libc6-dev'), or name one by the variable CC"
        )
    with TemporaryDirectory() as name:
        folder = Path(name)
        for path, content in sources.items():
            (folder / path).write_bytes(content)
        units = sorted(path for path in sources if path.endswith(".c"))
        done = subprocess.run(
            [*command, *LIBRARY_FLAGS, "-I.", *units, *_LINKER_FLAGS, "-lm", "-o", "unit.so"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            said = next(iter(done.stderr.splitlines()), f"exit code {done.returncode}")
            raise InputError(
                f"the C compiler '{command[0]}' fails: {said}; name another one by the variable CC"
            )
        return (folder / "unit.so").read_bytes()
