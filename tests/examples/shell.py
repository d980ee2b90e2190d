"""Shell commands as a user types them, with a program of the test's choice as `bms`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from bms.native_build import ROOT

BMS = f"""#!/usr/bin/env python3
import sys
if __name__ == "__main__":
    # python-can imports asammdf where it is, which takes seconds here and is not needed.
    sys.modules["asammdf"] = None
    sys.path.insert(0, {str(ROOT)!r})
    from bms.cli import main
    main()
"""
"""The command of these sources, by the first Python on the path."""


def run(
    command: Sequence[object], folder: Path, bms: str = BMS
) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder; what it prints is kept."""
    program = folder / "bin" / "bms"
    program.parent.mkdir(exist_ok=True)
    program.write_text(bms)
    program.chmod(0o755)
    # The Python that runs this stands before others.
    programs = [str(program.parent), str(Path(sys.executable).parent), os.environ["PATH"]]
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env={**os.environ, "PATH": os.pathsep.join(programs), "CFLAGS": "-Werror"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
