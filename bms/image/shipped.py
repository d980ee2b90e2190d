"""Whether a calibration has the content that the shipped model and preset which it names make."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from bms.image.parts import calibration_content
from bms.model.model_file import load_model, shipped_models
from bms.presets import load_preset, preset_names

_REMEDY = (
    "it was edited, or made by another version of bms; make it anew with 'bms export --out "
    "out/export' and flash it with 'bms flash --calibration out/export/calibration.bin'"
)


UNKNOWN_CONTENT = 0xFFFF_FFFF
"""CalibrationContent of an ECU that does not know its own."""


@cache
def shipped_contents() -> Mapping[tuple[str, str], int]:
    """Hashes of each shipped model and its preset -> CalibrationContent of the two.

    Takes most of a second the first time: call it before anything that must not wait.
    """
    presets = {name: load_preset(name) for name in preset_names()}
    contents = {}
    for path in shipped_models():
        model = load_model(path)
        preset = presets.get(model.preset or "")
        if preset is not None:
            contents[model.hash, preset.hash] = calibration_content(preset, model)
    return MappingProxyType(contents)


def _shipped_content(model_digits: str, preset_digits: str) -> int | None:
    for (model_hash, preset_hash), content in shipped_contents().items():
        if model_hash.startswith(model_digits) and preset_hash.startswith(preset_digits):
            return content
    return None


def foreign_content(model_hash: str, preset_hash: str, content: int) -> str | None:
    """What is wrong with the content of a calibration that names a model and a preset by hash.

    None where it is theirs, where they do not ship, so that nobody here knows it, and where the
    ECU does not know it.
    """
    if content == UNKNOWN_CONTENT:
        return None
    expected = _shipped_content(model_hash, preset_hash)
    return None if expected in (None, content) else content_text(content, expected)


def content_text(content: int, expected: int | None) -> str:
    """What is wrong with a calibration that has another content than its model and preset make."""
    return (
        f"the calibration is not what its model and preset make (content {content:08x}, not "
        f"{expected:08x}); {_REMEDY}"
    )
