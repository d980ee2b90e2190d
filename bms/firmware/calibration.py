"""Calibration blocks in memory that the C code can use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bms.calibration import NO_CHANGES, calibration_fields
from bms.errors import InputError, ModelMismatchError
from bms.firmware._firmware import ffi, lib
from bms.model.model_file import KanModel
from bms.native_build import ROOT
from bms.presets import DEFAULT_PRESET, Preset, load_preset

_HASHES_END = ffi.offsetof("bms_calibration_t", "sampling_period_s")


def calibration_bytes(preset: Preset, model: KanModel) -> bytes:
    """The calibration block as it stands in flash; raises what calibration_block raises."""
    return used_bytes(bytes(ffi.buffer(calibration_block(preset, model, compiled_in=False))))


def used_bytes(block: bytes) -> bytes:
    """A whole block up to the end of its model's tables, behind which the firmware reads nothing.

    Raises ValueError for fewer bytes than a block has, or a model whose sizes exceed the maxima.
    """
    size = ffi.sizeof("bms_calibration_t")
    if len(block) < size:
        raise ValueError(f"a calibration block has {size} bytes, not {len(block)}")
    kan = ffi.addressof(ffi.from_buffer("bms_calibration_t *", block), "kan")
    length = lib.kan_model_length(kan)
    if not length:
        raise ValueError("a calibration block whose model exceeds the maxima has no length")
    return block[: ffi.offsetof("bms_calibration_t", "kan") + length]


def calibration_hashes(content: bytes) -> tuple[int, int]:
    """First 32 bits of the hashes of model and preset in a block as it stands in flash.

    Raises ValueError for fewer bytes than they need.
    """
    if len(content) < _HASHES_END:
        raise ValueError(f"the hashes take {_HASHES_END} bytes of a block, not {len(content)}")
    block = ffi.cast("bms_calibration_t *", ffi.from_buffer(content))
    return block.model_hash, block.preset_hash


def calibration_block(
    preset: Preset,
    model: KanModel,
    *,
    compiled_in: bool,
    changes: Mapping[str, float] = NO_CHANGES,
) -> Any:
    """Pointer to a bms_calibration_t that stays valid as long as it is referenced.

    With compiled_in, the block in the binary is used for the preset and model that it was generated
    from. Raises ModelMismatchError when they should be those of the default preset and are not,
    and InputError when the firmware refuses the block. `changes` as in calibration_fields; they
    need a block of their own, not the compiled-in one.
    """
    block = lib.host_default_calibration()
    wanted = (int(model.hash[:8], 16), int(preset.hash[:8], 16))
    if not compiled_in or (block.model_hash, block.preset_hash) != wanted:
        # A changed copy of the default preset has its name, but not its hash.
        if (
            compiled_in
            and preset.name == DEFAULT_PRESET
            and preset.hash == load_preset(DEFAULT_PRESET).hash
        ):
            raise ModelMismatchError(
                f"compiled-in tables are not those of preset '{preset.name}' and its model; "
                + _regeneration()
            )
        block = ffi.new("bms_calibration_t *", calibration_fields(preset, model, changes))
    if not lib.calibration_is_valid(block):
        raise InputError(
            f"preset '{preset.name}' with model {model.hash[:8]}: the firmware does not accept "
            f"{_refused(calibration_fields(preset, model, changes))}; check cell, limits and gains "
            f"with 'bms verify --preset PRESET'"
        )
    return block


def _regeneration() -> str:
    if (ROOT / "Makefile").is_file():
        return "run 'make generate' and 'make build'"
    return "install it again with 'pip install --force-reinstall kan-rcbf-bms'"


def _refused(fields: Mapping[str, Any]) -> str:
    """Names and values of the constants without which the block would be accepted.

    Each is tried alone in an otherwise good block, the compiled-in one.
    """
    wrong = []
    for names, values in _constants(fields).items():
        block = ffi.new("bms_calibration_t *", lib.host_default_calibration()[0])
        for path, value in values.items():
            _put(block, path, value)
        if not lib.calibration_is_valid(block):
            shown = [f" {value:.6g}" for value in values.values() if isinstance(value, float)]
            wrong.append(names + "".join(shown))
    return ", ".join(wrong) or "the network of the model"


def _constants(fields: Mapping[str, Any]) -> dict[str, dict[tuple[str, ...], Any]]:
    """What is good or bad by itself, by name; the tables of the network belong together."""
    found: dict[str, dict[tuple[str, ...], Any]] = {}

    def collect(section: Mapping[str, Any], path: tuple[str, ...]) -> None:
        for name, value in section.items():
            here = (*path, name)
            if name == "kan":
                continue
            if isinstance(value, Mapping) and not set(value) & {"high_K", "low_K"}:
                collect(value, here)
            elif isinstance(value, Mapping):
                found[name] = {(*here, key): part for key, part in value.items()}
            elif name.startswith("ocv_"):
                found.setdefault("ocv", {})[here] = value
            else:
                found[".".join(here)] = {here: value}

    collect(fields, ())
    return found


def _put(block: Any, path: tuple[str, ...], value: Any) -> None:
    for name in path[:-1]:
        block = getattr(block, name)
    setattr(block, path[-1], value)
