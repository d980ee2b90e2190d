"""The firmware's kernels against their plain forms on random states of all shipped calibrations.

    python -m tests.firmware.native.kernels [STATES] [SEED]

STATES (30 million by default) are spread evenly over the calibrations. Exit code 1 when a bit of
any answer differs. Needs a C compiler.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bms.firmware.calibration import calibration_bytes
from bms.model.model_file import load_model
from bms.native_build import ROOT
from bms.presets import load_preset
from tests.firmware.native.build import build_program

STATES = 30_000_000
LAGGED = "_lagged"


def shipped_blocks() -> Iterator[tuple[str, bytes]]:
    """Name and calibration of every model that ships, with its preset."""
    for path in sorted((ROOT / "bms" / "models").glob("*.json")):
        preset = load_preset(path.stem.removesuffix(LAGGED))
        yield path.stem, calibration_bytes(preset, load_model(path))


def compare(program: Path, block: bytes, states: int, seed: int) -> tuple[dict[str, Any], str]:
    """What the program says of one calibration, and the first states that differ."""
    with tempfile.NamedTemporaryFile() as file:
        Path(file.name).write_bytes(block)
        done = subprocess.run(
            [str(program), file.name, str(states), str(seed)],
            capture_output=True,
            text=True,
            check=False,
        )
    if not done.stdout:
        raise RuntimeError(done.stderr)
    said: dict[str, Any] = json.loads(done.stdout)
    return said, done.stderr


def main() -> int:
    """Compare on all of them and print a line for each."""
    states = int(sys.argv[1]) if len(sys.argv) > 1 else STATES
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    program = build_program("kernels", ROOT / "build" / "native", sanitize=False)
    blocks = list(shipped_blocks())
    differing = 0
    for number, (name, block) in enumerate(blocks):
        said, first = compare(program, block, -(-states // len(blocks)), seed + number)
        print(f"{name}: {json.dumps(said)}", flush=True)
        print(first, end="", file=sys.stderr)
        differing += sum(said["differing"].values())
    print(f"{differing} answers differ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
