"""Runs the counting program on an emulated board."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

from bms.errors import InputError
from bms.image import make_command, port_name
from hil_sim.studies.cost.records import INSTRUCTION_SHIFT, Counts, counts
from hil_sim.targets import Emulation

TIMEOUT_S = 1800.0
"""Many times what a search and its charges take."""


def count(
    program: Path,
    board: str,
    records: Iterable[bytes],
    timeout_s: float = TIMEOUT_S,
    calibration: bytes | None = None,
) -> Counts:
    """Instructions of each record that is not a restart; `calibration` is a block in place of the
    compiled-in one.

    Raises InputError when the program is not built or does not end within timeout_s, QEMU is
    missing or the board is unknown.
    """
    if not program.is_file():
        remedy = make_command(port_name(board), program.name)
        raise InputError(f"{program}: not built; run '{remedy}'")
    with tempfile.TemporaryDirectory() as name:
        inputs, results = Path(name) / "records", Path(name) / "ticks"
        inputs.write_bytes(b"".join(records))
        semihosting = f"enable=on,target=native,arg=cost,arg={inputs},arg={results}"
        if calibration is not None:
            block = Path(name) / "calibration"
            block.write_bytes(calibration)
            semihosting += f",arg={block}"
        options = ("-icount", f"shift={INSTRUCTION_SHIFT}", "-semihosting-config", semihosting)
        with Emulation(program, board, options=options) as emulation:
            status = emulation.wait(timeout_s)
        if status is None:
            raise InputError(
                f"{program}: has not ended on {board} in {timeout_s:g} s; build it anew"
            )
        if status != 0:
            raise InputError(f"{program}: ended with status {status} on {board}; build it again")
        return counts(results.read_bytes())
