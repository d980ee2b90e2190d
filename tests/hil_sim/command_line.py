"""The `bms` command in a process of its own, as a shell calls it.

On a busy machine a short command takes long enough to say so; here it never does.
"""

import subprocess
import sys

PROGRAM = (
    "import bms.waiting; bms.waiting.FIRST_LINE_S = 1e9; from bms.cli import main; main()"
)  # fmt: skip


def bms(*arguments, folder=None):
    """Finished process with exit code, stdout and stderr."""
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=folder,
        check=False,
    )
