"""`python -m codegen`: regenerate the checked-in sources of firmware_c/generated."""

from pathlib import Path

from bms.kan.model_file import load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.rendering import write_files

GENERATED = Path(__file__).resolve().parents[1] / "firmware_c" / "generated"

if __name__ == "__main__":
    sources = calibration_source(load_preset(DEFAULT_PRESET), load_shipped_model(DEFAULT_PRESET))
    write_files(GENERATED, {**can_sources(), **sources})
