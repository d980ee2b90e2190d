"""`bms export`: what the firmware takes from a model and a preset, or the whole C core with it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.commands import options
from bms.errors import InputError, ModelMismatchError
from bms.image import calibration_part
from bms.model.pair import load_pair
from bms.model.start import unknown_start
from bms.presets import DEFAULT_PRESET
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.core_sources import core_sources, write_core
from codegen.rendering import write_files

CALIBRATION_FILE = "calibration.bin"


def export(
    out: Annotated[
        Path | None,
        options.out_folder_option("the generated C sources and calibration.bin", default=None),
    ] = None,
    sources: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the whole C core, to be built by CMake; created when absent."
        ),
    ] = None,
    preset: options.PresetOption = DEFAULT_PRESET,
    model: options.ModelOption = None,
) -> None:
    """Write what the firmware takes from a model, or the C core with it for a project of your own.

    With --out: controller constants, KAN tables and CAN codec as C sources; calibration.bin holds
    the same constants and tables for 'bms flash --calibration'. With --sources: headers and sources
    of the core with these generated ones, a CMakeLists.txt and a README that says how to call it.

    Temperatures in K, currents in A (negative while charging), times in s.

    Example: bms export --model model.json --preset paper_calibrated --out out/export
    """
    if out is None and sources is None:
        raise InputError("export: no folder is named; add --out DIR, --sources DIR or both")
    chosen, estimator = load_pair(preset, model)
    start = unknown_start(chosen, estimator)
    if start is not None:
        raise ModelMismatchError(f"--model {model}: {start.reason}; {start.change}")
    generated: dict[str, str | bytes] = {}
    if out is not None:
        generated = {
            **can_sources(),
            **calibration_source(chosen, estimator),
            CALIBRATION_FILE: calibration_part(chosen, estimator),
        }
    core = core_sources(chosen, estimator) if sources is not None else {}
    written: list[Path] = []
    if out is not None:
        written += write_files(out, generated)
    if sources is not None:
        written += write_core(sources, core)
    for path in written:
        print(path)
