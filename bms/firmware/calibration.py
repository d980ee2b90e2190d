"""Calibration blocks in memory that the C code can use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bms.errors import InputError, ModelMismatchError
from bms.firmware._firmware import ffi, lib
from bms.kan.model_file import KanModel, load_model, load_shipped_model
from bms.presets import DEFAULT_PRESET, Preset, load_preset
from bms.tables import calibration_fields


def load_pair(
    preset: str | Path | Preset, model: str | Path | KanModel | None
) -> tuple[Preset, KanModel]:
    """Preset and model by name, path or object; without a model the one that ships with it."""
    chosen = preset if isinstance(preset, Preset) else load_preset(preset)
    if isinstance(model, KanModel):
        return chosen, model
    return chosen, load_shipped_model(chosen.name) if model is None else load_model(Path(model))


def calibration_block(preset: Preset, model: KanModel, *, compiled_in: bool) -> Any:
    """Pointer to a bms_calibration_t that stays valid as long as it is referenced.

    With compiled_in, the block in the binary is used for the default preset, after a check that
    preset and model are those it was generated from. Raises ModelMismatchError when they are not,
    and InputError when the firmware refuses the block.
    """
    if compiled_in and preset.name == DEFAULT_PRESET:
        block = lib.host_default_calibration()
        wanted = (int(model.hash[:8], 16), int(preset.hash[:8], 16))
        if (block.model_hash, block.preset_hash) != wanted:
            raise ModelMismatchError(
                f"compiled-in tables are not those of preset '{preset.name}' and its model; "
                "run 'make generate' and install again"
            )
    else:
        block = ffi.new("bms_calibration_t *", calibration_fields(preset, model))
    if not lib.calibration_is_valid(block):
        raise InputError(
            f"preset '{preset.name}' with model {model.hash[:8]}: a constant is out of the range "
            "that the firmware accepts; check cell, limits and gains"
        )
    return block
