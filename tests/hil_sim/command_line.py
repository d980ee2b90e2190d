"""The `bms` command in a process of its own, as a shell calls it."""

import subprocess
import sys


def bms(*arguments, folder=None):
    """Finished process with exit code, stdout and stderr."""
    return subprocess.run(
        [sys.executable, "-c", "from bms.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=folder,
        check=False,
    )
