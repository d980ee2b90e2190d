"""`python -m codegen`: write what is generated and checked in anew.

That is firmware_c/generated, hil_sim/bus/catalog.py and docs/can.md, and of packs
codegen/can/pack.dbc, firmware_c/pack/generated and docs/can-pack.md.
"""

import sys
from pathlib import Path

from bms.model.model_file import load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_document import can_document
from codegen.can_names import can_names
from codegen.can_sources import can_sources
from codegen.pack_database import pack_database
from codegen.pack_document import pack_document
from codegen.pack_sources import pack_sources
from codegen.rendering import write_files

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware_c"

if __name__ == "__main__":
    if not (ROOT / "Makefile").is_file():
        reason = f"{ROOT} is no checkout; 'bms export' writes the sources into another folder"
        print(f"codegen: {reason}", file=sys.stderr)
        sys.exit(2)
    sources = calibration_source(load_preset(DEFAULT_PRESET), load_shipped_model(DEFAULT_PRESET))
    write_files(FIRMWARE / "generated", {**can_sources(), **sources})
    write_files(ROOT / "hil_sim" / "bus", can_names())
    write_files(ROOT / "docs", {"can.md": can_document(FIRMWARE)})
    write_files(ROOT / "codegen" / "can", pack_database())  # before what is made of it
    write_files(FIRMWARE / "pack" / "generated", pack_sources())
    write_files(ROOT / "docs", {"can-pack.md": pack_document()})
