"""`bms flash`: puts an image or a calibration into the flash of a board and starts the board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from bms.commands.options import JsonOption
from bms.errors import InputError
from hil_sim.commands.stopping import stop_event
from hil_sim.targets import Emulation, Flash
from hil_sim.targets.catalog import BOARD_NAMES, DEFAULT_BOARD, board_name

_POLL_S = 0.1


def flash(
    target: Annotated[
        str, typer.Option("--target", help=f"Board: {' or '.join(BOARD_NAMES)}.")
    ] = DEFAULT_BOARD,
    image: Annotated[
        Path | None,
        typer.Option("--image", help="Binary image of 'make firmware'. Default: what is in flash."),
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration", help="Calibration part of 'bms export', in place of the present one."
        ),
    ] = None,
    flash_file: Annotated[
        Path | None,
        typer.Option("--flash", help="File of the flash. Default: build/flash/BOARD.bin."),
    ] = None,
    allow_older: Annotated[
        bool,
        typer.Option(
            "--allow-older", help="Take firmware that is older than what the board has had."
        ),
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            "--port", min=0, max=65535, help="TCP port of the serial line. Default: a free one."
        ),
    ] = 0,
    log: Annotated[
        Path | None, typer.Option("--log", help="File for what the emulator says. Default: none.")
    ] = None,
    start: Annotated[
        bool, typer.Option("--start/--no-start", help="Start the board until Ctrl-C or SIGTERM.")
    ] = True,
    as_json: JsonOption = False,
) -> int:
    """Program the emulated flash of a board, then run the board until Ctrl-C or SIGTERM.

    The board speaks slcan on its serial line, which one party can use at a time. What is damaged,
    truncated or made for something else is refused, and the flash stays as it is.

    Example: bms flash --image build/firmware/mps2_an386/firmware.bin --port 5000
    """
    board = board_name(target)
    memory = Flash(flash_file or Path("build/flash") / f"{board}.bin", board)
    if image is not None or calibration is not None:
        memory.program(image, calibration, allow_older)
    application, present = memory.headers()
    report: dict[str, str | int] = {
        "target": target,
        "flash": str(memory.path),
        "firmware_version": application.firmware_version,
        "application_length_bytes": application.length,
        "calibration_length_bytes": present.length,
        "model_hash": f"{present.model_hash:08x}",
        "preset_hash": f"{present.preset_hash:08x}",
        "calibration_content": f"{present.content_hash:08x}",
    }
    if not start:
        _print(report, as_json)
        return 0
    stop = stop_event()
    with Emulation(memory.path, board, port, log) as emulation:
        _print({**report, "bus": emulation.bus}, as_json)
        while emulation.is_running and not stop.wait(_POLL_S):
            pass
        ended = not emulation.is_running and not stop.is_set()
    if ended:
        raise InputError(f"target '{target}': the emulator ended by itself; see --log FILE")
    return 0


def _print(report: dict[str, str | int], as_json: bool) -> None:
    if as_json:
        print(json.dumps(report), flush=True)
        return
    print(
        "{flash}: firmware version {firmware_version} ({application_length_bytes} bytes), model "
        "{model_hash}, preset {preset_hash} ({calibration_length_bytes} bytes, content "
        "{calibration_content})".format(**report)
    )
    if "bus" in report:
        print(f"{report['target']} runs on bus {report['bus']}; Ctrl-C ends it", flush=True)
