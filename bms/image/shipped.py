"""Whether a calibration has the content that the shipped model and preset which it names make."""

from __future__ import annotations

from functools import lru_cache

from bms.errors import ModelMismatchError
from bms.image.parts import calibration_content
from bms.model.model_file import load_model, shipped_models
from bms.presets import load_preset, preset_names

_REMEDY = (
    "it was edited, or made by another version of bms; make it anew with 'bms export --out "
    "out/export' and flash it with 'bms flash --calibration out/export/calibration.bin'"
)


UNKNOWN_CONTENT = 0xFFFF_FFFF
"""CalibrationContent of an ECU that does not know its own."""


@lru_cache
def shipped_content(model_hash: str, preset_hash: str) -> int | None:
    """CalibrationContent of the shipped pair that these first digits name; None without one."""
    presets = (load_preset(name) for name in preset_names())
    models = (load_model(path) for path in shipped_models())
    preset = next((p for p in presets if p.hash.startswith(preset_hash)), None)
    model = next((m for m in models if m.hash.startswith(model_hash)), None)
    if preset is None or model is None:
        return None
    try:
        return calibration_content(preset, model)
    except ModelMismatchError:
        return None


def foreign_content(model_hash: str, preset_hash: str, content: int) -> str | None:
    """What is wrong with the content of a calibration that names a model and a preset by hash.

    None where it is theirs, where they do not ship, so that nobody here knows it, and where the
    ECU does not know it.
    """
    if content == UNKNOWN_CONTENT:
        return None
    expected = shipped_content(model_hash, preset_hash)
    return None if expected in (None, content) else content_text(content, expected)


def content_text(content: int, expected: int | None) -> str:
    """What is wrong with a calibration that has another content than its model and preset make."""
    return (
        f"the calibration is not what its model and preset make (content {content:08x}, not "
        f"{expected:08x}); {_REMEDY}"
    )
