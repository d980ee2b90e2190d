"""Instructions of a period of a pack's ECU on a Cortex-M4F: `python -m hil_sim.pack.cost`."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from bms.text_table import TextTable
from hil_sim.studies.pack.cost import counts, instructions_in

PROGRAM = Path("build/firmware/mps2_an386/pack_ecu_cost.elf")
BUILD_COMMAND = f"make -f firmware_c/pack_cost/pack_cost.mk {PROGRAM}"
_COUNT = struct.Struct("<6I")


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
    return [_of(*values) for values in counts(program, BUILD_COMMAND, _COUNT)]


def _of(
    cells: int, frames: int, nothing: int, least: int, most: int, periods: int
) -> EcuInstructions:
    least, most = instructions_in(least, nothing), instructions_in(most, nothing)
    return EcuInstructions(cells, frames, least, most, periods)


def main() -> None:
    """Print the table."""
    table = TextTable("cells", "frames", "least", "most", title="Instructions of a pack's ECU")
    for one in ecu_instructions():
        table.add_row(str(one.cells), str(one.frames), f"{one.least}", f"{one.most}")
    table.print(Console())


if __name__ == "__main__":
    main()
