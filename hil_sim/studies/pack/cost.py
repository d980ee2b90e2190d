"""What a control period of a pack costs: time on this machine, instructions on a Cortex-M4F, RAM.

`python -m hil_sim.studies.pack.cost` prints the table.
"""

from __future__ import annotations

import json
import struct
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from bms.text_table import TextTable
from hil_sim.studies.cost.records import INSTRUCTION_SHIFT, TICK_NS
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import Core
from hil_sim.studies.pack.reserves import NO_RESERVES
from hil_sim.targets import Emulation

CELLS = (1, 4, 16, 96, 192)
BOARD = "mps2-an386"
PROGRAM = Path("build/firmware/mps2_an386/pack_cost.elf")
BUILD_COMMAND = f"make -f firmware_c/pack_cost/pack_cost.mk {PROGRAM}"
_COUNT = struct.Struct("<7I")
_SETS = 16
_TIMEOUT_S = 300.0


@dataclass(frozen=True)
class Instructions:
    """Instructions of a period with a decision, and RAM, of a pack on the board."""

    cells: int
    is_rising: bool
    """Each cell is warmer than those before it, so that each moves the pack's current."""
    least: int
    most: int
    periods: int
    pack_bytes: int


def counts(program: Path, build_command: str, record: struct.Struct) -> list[tuple[int, ...]]:
    """Records that a counting program writes in QEMU.

    Raises InputError where the program is not built or does not end well.
    """
    if not program.is_file():
        raise InputError(f"{program}: not built; run '{build_command}'")
    with tempfile.TemporaryDirectory() as name:
        results = Path(name) / "counts"
        semihosting = f"enable=on,target=native,arg=cost,arg={results}"
        options = ("-icount", f"shift={INSTRUCTION_SHIFT}", "-semihosting-config", semihosting)
        with Emulation(program, BOARD, options=options) as emulation:
            status = emulation.wait(_TIMEOUT_S)
        if status != 0:
            raise InputError(f"{program}: has not ended well on {BOARD}; build it anew")
        return list(record.iter_unpack(results.read_bytes()))


def instructions_in(ticks: int, nothing: int) -> int:
    """Instructions in ticks of the timer, of which `nothing` are those of the reading itself."""
    return round((ticks - nothing) * TICK_NS / 2.0**INSTRUCTION_SHIFT)


def instructions(program: Path = PROGRAM) -> list[Instructions]:
    """Of the pack's core, counted in QEMU; InputError as `counts`."""
    return [_instructions(*values) for values in counts(program, BUILD_COMMAND, _COUNT)]


def _instructions(
    cells: int, rising: int, pack_bytes: int, nothing: int, least: int, most: int, periods: int
) -> Instructions:
    least, most = instructions_in(least, nothing), instructions_in(most, nothing)
    return Instructions(cells, bool(rising), least, most, periods, pack_bytes)


def host_us(cells: int, periods: int = 200, repeats: int = 25) -> float:
    """Least mean time in us of a control period of a derated charge of so many cells."""
    preset, model = load_pair(DEFAULT_PRESET, None)
    core = Core(preset, model, NO_RESERVES)
    rng = np.random.default_rng(cells)
    pack = ffi.new("pack_t *")
    kept: list[Any] = []  # readings point to them
    owners = ffi.new("uint8_t[]", list(range(cells)))
    config = {
        "calibration": core.calibration,
        "cells": cells,
        "thermistors": cells,
        "thermistor_of": owners,
    }
    lib.pack_init(pack, ffi.new("pack_config_t *", config))
    socs = ffi.new("float[]", [0.5] * cells)

    def readings(charge: bool, surface_K: float, current_A: float) -> Any:
        voltage_V = preset.cell.ocv(0.5) - current_A * preset.cell.ohmic_resistance_ohm
        voltages = ffi.new("float[]", (voltage_V + 1e-3 * rng.standard_normal(cells)).tolist())
        surfaces = ffi.new("float[]", (surface_K + 0.02 * rng.standard_normal(cells)).tolist())
        kept.extend((voltages, surfaces))
        return {
            "current_A": current_A,
            "voltage_V": voltages,
            "surface_temperature_K": surfaces,
            "coolant_in_K": surface_K - 10.0,
            "coolant_out_K": surface_K - 10.0,
            "charge": charge,
            "reference_current_A": preset.limits.reference_current_A,
            "plug_in_soc": socs,
        }

    surface_K = preset.limits.max_core_temperature_K - 6.0
    idle = ffi.new("pack_readings_t[]", [readings(False, surface_K, 0.0)])
    lib.pack_repeat(pack, idle, 1, 10)
    for _ in range(400):
        # The current that the command becomes, until the limit has been met.
        one = ffi.new("pack_readings_t[]", [readings(True, surface_K, float(pack.command_A))])
        lib.pack_repeat(pack, one, 1, 1)
        del kept[:-2]
    command_A = float(pack.command_A)
    assert pack.decision.cell != lib.PACK_NO_CELL, "no cell governs"
    sets = ffi.new(
        "pack_readings_t[]", [readings(True, surface_K, command_A) for _ in range(_SETS)]
    )
    times_s, before = [], bytes(ffi.buffer(pack))
    for _ in range(repeats):
        ffi.buffer(pack)[:] = before
        begin_s = time.perf_counter()
        lib.pack_repeat(pack, sets, _SETS, periods)
        times_s.append(time.perf_counter() - begin_s)
    assert pack.command_A < 0.0, "the charge has ended while it was timed"
    return 1e6 * min(times_s) / periods


def host_bytes(cells: int, has_family: bool) -> int:
    """State of a pack of so many cells on this machine."""
    each = ffi.sizeof("pack_cell_t") + (ffi.sizeof("family_t") if has_family else 0)
    shared = (
        ffi.sizeof("pack_t")
        - lib.BMS_MAX_CELLS * ffi.sizeof("pack_cell_t")
        - lib.BMS_MAX_FAMILY_CELLS * ffi.sizeof("family_t")
    )
    return int(shared + cells * each)


def main() -> None:
    """Print the table, and the same as JSON; without the board's program it has no figures."""
    try:
        counted = instructions()
    except InputError as error:
        counted = []
        print(f"not run: instructions of the Cortex-M4F: {error}", file=sys.stderr)
    table = TextTable(
        "cells", "host us", "M4F most", "M4F least", "RAM B", "RAM with family B",
        title="A control period of a pack",
    )  # fmt: skip
    rows = []
    for cells in CELLS:
        own = [c for c in counted if c.cells == cells]
        row = {
            "cells": cells,
            "host_us": host_us(cells),
            "board": [asdict(c) for c in own],
            "bytes": host_bytes(cells, False),
            "family_bytes": host_bytes(cells, True),
        }
        rows.append(row)
        table.add_row(
            str(cells),
            f"{row['host_us']:.2f}",
            str(max(c.most for c in own)) if own else "–",
            str(min(c.least for c in own)) if own else "–",
            str(own[0].pack_bytes) if own else "–",
            f"{row['family_bytes']}",
        )
    table.print(Console())
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
