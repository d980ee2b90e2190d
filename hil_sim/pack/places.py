"""The same frames into a pack's ECU in several places: on this host, in a process, on a board.

firmware_c/pack_cost/pack_answers.c is the program that a process or a board runs.
"""

from __future__ import annotations

import os
import struct
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bms.errors import BusError, InputError
from hil_sim.bus.frame import Frame
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.frames import FRAME, packed
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.cost import BOARD
from hil_sim.studies.pack.engine import NO_THERMISTOR
from hil_sim.targets import Emulation

Period = list[Frame]
"""Frames of a period, without SYNC, or the answer to them."""
BOARD_PROGRAM = Path("build/firmware/mps2_an386/pack_answers.elf")
_HEADING = struct.Struct("<IIIf")
_TIMEOUT_S = 120.0


def recording(settings: PackChargeSettings, periods: Sequence[Period]) -> bytes:
    """What pack_answers.c reads: the ECU's configuration, then frames, a SYNC for each period."""
    core, view = settings.core(), settings.view
    owner_of = view.thermistor_of + [NO_THERMISTOR] * (lib.BMS_MAX_CELLS - settings.cells)
    size, count = ffi.sizeof("bms_calibration_t"), len(view.thermistors)
    heading = _HEADING.pack(size, settings.cells, count, settings.pack_voltage_error_V)
    structures = [ffi.new("pack_bare_t *", core.reserves.bare)]
    structures += [ffi.new("pack_horizon_t *", one) for one in settings.horizons()]
    structures.append(ffi.new("pack_balance_t *", settings.balance()))
    heading += b"".join(bytes(ffi.buffer(one)) for one in structures) + bytes(owner_of)
    heading += bytes(ffi.buffer(core.calibration))
    sync = Frame(lib.PACK_SYNC_ID, b"")
    return heading + b"".join(packed([*frames, sync]) for frames in periods)


def answers_of_host(settings: PackChargeSettings, periods: Sequence[Period]) -> bytes:
    """The frames that the ECU of this process sends, as packed has them."""
    ecu = PackEcu(settings)
    return b"".join(packed(ecu.exchange(frames)) for frames in periods)


def answers_of_process(program: Path, content: bytes) -> bytes:
    """Those of pack_answers.c as a process; BusError when it does not end well."""
    with tempfile.TemporaryDirectory() as name:
        paths = [Path(name) / part for part in ("recording", "answers")]
        paths[0].write_bytes(content)
        line = " ".join(["answers", *map(str, paths)])
        done = subprocess.run(
            [program], env={**os.environ, "COMMAND_LINE": line}, timeout=_TIMEOUT_S, check=False
        )
        return _answers(program, done.returncode, paths[1])


def answers_of_board(content: bytes, program: Path = BOARD_PROGRAM) -> bytes:
    """Those of pack_answers.c on an emulated Cortex-M4F.

    Raises InputError where it is not built, BusError where it does not end well.
    """
    if not program.is_file():
        make = "make -f firmware_c/pack_cost/pack_cost.mk"
        raise InputError(f"{program}: not built; run '{make} {BOARD_PROGRAM}'")
    with tempfile.TemporaryDirectory() as name:
        paths = [Path(name) / part for part in ("recording", "answers")]
        paths[0].write_bytes(content)
        words = ",".join(f"arg={word}" for word in ("answers", *paths))
        options = ("-semihosting-config", f"enable=on,target=native,{words}")
        with Emulation(program, BOARD, options=options) as emulation:
            status = emulation.wait(_TIMEOUT_S)
        return _answers(program, status, paths[1])


def difference(one: bytes, other: bytes) -> str | None:
    """The first frame that differs, in words; None for equal answers."""
    if one == other:
        return None
    for n, (a, b) in enumerate(zip(FRAME.iter_unpack(one), FRAME.iter_unpack(other))):
        if a != b:
            return f"frame {n}: {a[0]:03X}#{a[2].hex()} and {b[0]:03X}#{b[2].hex()}"
    return f"{len(one) // FRAME.size} and {len(other) // FRAME.size} frames"


def _answers(program: Path, status: int | None, answers: Path) -> bytes:
    if status != 0:
        raise BusError(
            f"{program}: has not ended well ({status}); build it anew from the sources of this bms"
        )
    return answers.read_bytes()
