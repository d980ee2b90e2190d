"""`bms export`: C sources and calibration part for a model and a preset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from bms.commands import options
from bms.image import calibration_part
from bms.model.model_file import load_model, load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.rendering import write_files

CALIBRATION_FILE = "calibration.bin"


def export(
    out: Annotated[
        Path, options.out_folder_option("the C sources and calibration.bin", default=None)
    ],
    preset: options.PresetOption = DEFAULT_PRESET,
    model: options.ModelOption = None,
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
