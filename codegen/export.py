"""`bms export`: C sources and calibration part for a model and a preset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.image import calibration_part
from bms.model.model_file import load_model, load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.rendering import write_files

CALIBRATION_FILE = "calibration.bin"


def export(
    out: Annotated[Path, typer.Option(help="Folder for the C sources; created when absent.")],
    preset: Annotated[
        str, typer.Option(help="Preset by name, or path of a .toml file.")
    ] = DEFAULT_PRESET,
    model: Annotated[
        Path | None, typer.Option(help="Model JSON of 'bms train'. Default: the preset's own.")
    ] = None,
) -> None:
    """Write what the firmware takes from a model: generated C sources and a calibration part.

    The sources are controller constants, KAN tables and CAN codec. calibration.bin holds the same
    constants and tables for 'bms flash --calibration'.

    Temperatures in K, currents in A (negative while charging), times in s.

    Example: bms export --model model.json --preset paper_calibrated --out out/export
    """
    chosen = load_preset(preset)
    estimator = load_model(model) if model else load_shipped_model(chosen.name)
    contents: dict[str, str | bytes] = {
        **can_sources(),
        **calibration_source(chosen, estimator),
        CALIBRATION_FILE: calibration_part(chosen, estimator),
    }
    for path in write_files(out, contents):
        print(path)
