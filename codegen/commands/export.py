"""`bms export`: C sources for a model and a preset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.kan.model_file import load_model, load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.rendering import write_files


def export(
    out: Annotated[Path, typer.Option(help="Folder for the C sources; created when absent.")],
    preset: Annotated[
        str, typer.Option(help="Preset by name, or path of a .toml file.")
    ] = DEFAULT_PRESET,
    model: Annotated[
        Path | None, typer.Option(help="Model JSON of 'bms train'. Default: the preset's own.")
    ] = None,
) -> None:
    """Write the firmware's generated C sources: controller constants, KAN tables and CAN codec.

    Temperatures in K, currents in A (negative while charging), times in s.

    Example: bms export --model model.json --preset paper_calibrated --out firmware_c/generated
    """
    chosen = load_preset(preset)
    estimator = load_model(model) if model else load_shipped_model(chosen.name)
    contents = {**can_sources(), **calibration_source(chosen, estimator)}
    for path in write_files(out, contents):
        print(path)
