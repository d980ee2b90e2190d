"""Instructions of a period of a pack's ECU on a Cortex-M4F: `python -m hil_sim.pack.cost`."""

from __future__ import annotations

import struct
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from bms.errors import InputError
from bms.text_table import TextTable
from hil_sim.studies.cost.records import INSTRUCTION_SHIFT, TICK_NS
from hil_sim.studies.pack.cost import BOARD
from hil_sim.targets import Emulation

PROGRAM = Path("build/firmware/mps2_an386/pack_ecu_cost.elf")
BUILD_COMMAND = f"make -f firmware_c/pack_cost/pack_cost.mk {PROGRAM}"
_COUNT = struct.Struct("<6I")
_TIMEOUT_S = 300.0


@dataclass(frozen=True)
class EcuInstructions:
    """Of a period with a current, from the first frame taken to the last one given."""

    cells: int
    frames: int
    least: int
    most: int
    periods: int


def ecu_instructions(program: Path = PROGRAM) -> list[EcuInstructions]:
    """Counted in QEMU; InputError where the program is not built or does not end well."""
    if not program.is_file():
        raise InputError(f"{program}: not built; run '{BUILD_COMMAND}'")
    with tempfile.TemporaryDirectory() as name:
        results = Path(name) / "counts"
        semihosting = f"enable=on,target=native,arg=cost,arg={results}"
        options = ("-icount", f"shift={INSTRUCTION_SHIFT}", "-semihosting-config", semihosting)
        with Emulation(program, BOARD, options=options) as emulation:
            status = emulation.wait(_TIMEOUT_S)
        if status != 0:
            raise InputError(f"{program}: has not ended well on {BOARD}; build it anew")
        return [_of(*values) for values in _COUNT.iter_unpack(results.read_bytes())]


def _of(
    cells: int, frames: int, nothing: int, least: int, most: int, periods: int
) -> EcuInstructions:
    def of(ticks: int) -> int:
        return round((ticks - nothing) * TICK_NS / 2.0**INSTRUCTION_SHIFT)

    return EcuInstructions(cells, frames, of(least), of(most), periods)


def main() -> None:
    """Print the table."""
    table = TextTable("cells", "frames", "least", "most", title="Instructions of a pack's ECU")
    for one in ecu_instructions():
        table.add_row(str(one.cells), str(one.frames), f"{one.least}", f"{one.most}")
    table.print(Console())


if __name__ == "__main__":
    main()
