"""CMake builds for whoever tests what a user would build with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

IS_CI = "CI" in os.environ
CMAKE = shutil.which(
    "cmake", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
)
needs_cmake = pytest.mark.skipif(
    CMAKE is None and not IS_CI, reason="not run: cmake is not installed; pip install cmake"
)


def build(source: Path, out: Path, *options: str) -> Path:
    """Build folder of a project, with warnings as errors; fails with what CMake says."""
    assert CMAKE is not None, "cmake is not installed; pip install cmake"
    configure = [CMAKE, "-S", source, "-B", out, *options]
    for command in (configure, [CMAKE, "--build", out, "--parallel", "2"]):
        environment = {**os.environ, "CFLAGS": "-Werror"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in (done.stdout + done.stderr).lower(), done.stdout + done.stderr
    return out
