"""A preset with limits tighter than its own, as the page asks for it: file and calibration.

A limit may only be lowered: certificate, model and its error bound hold for what the preset allows.
Everything that follows from a limit (margins, planner, plausibility) is derived again.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping

from bms.errors import InputError
from bms.presets import Preset, load_preset, preset_path
from bms.validation import parse

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TIGHTENED = (
    "max_voltage_V",
    "max_core_temperature_K",
    "max_surface_temperature_K",
    "max_soc",
    "completion_soc",
)
"""Keys of [limits] that may be lowered. The strongest current is not among them: the model was
trained up to it, and a request may ask for less."""

_STEPS = {
    "max_voltage_V": (0.02, 0.05),
    "max_core_temperature_K": (2.0, 5.0),
    "max_surface_temperature_K": (2.0, 5.0),
    "completion_soc": (0.1, 0.2),
}
"""By how much files without a server have each limit lowered."""


def steps(preset: Preset) -> dict[str, list[str]]:
    """The values that files without a server have of each limit, one limit at a time."""
    limits = preset.limits
    return {
        key: [f"{getattr(limits, key) - step:.10g}" for step in by] for key, by in _STEPS.items()
    }


def tightened(name: str, wanted: Mapping[str, str]) -> tuple[Preset, str]:
    """The preset, by name or path, with some limits lowered, and the text of its file.

    Raises InputError for a limit that is none, no number, or looser than the preset's, and for
    limits that do not agree.
    """
    base = load_preset(name)
    text = preset_path(name).read_text(encoding="utf-8")
    for key, said in wanted.items():
        if key not in TIGHTENED:
            raise InputError(f"limits.{key}: cannot be changed here; one of {', '.join(TIGHTENED)}")
        text = _with_limit(text, key, _lowered(key, said, getattr(base.limits, key)))
    return parse(Preset, tomllib.loads(text), "tightened limits"), text


def _lowered(key: str, said: str, limit: float) -> float:
    try:
        value = float(said)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value <= 0.0:
        raise InputError(f"limits.{key}: '{said[:40]}' is no positive number; at most {limit:.10g}")
    if value > limit:
        raise InputError(
            f"limits.{key}: {value:.10g} is looser than the preset's {limit:.10g}, which its "
            "certificate is for; give that or less, or make a preset of your own (bms preset)"
        )
    return value


def _with_limit(text: str, key: str, value: float) -> str:
    head, table, rest = text.partition("\n[limits]\n")
    line = re.compile(rf"^{key}[ \t]*=.*$", re.MULTILINE)
    changed, count = line.subn(f"{key} = {value!r}", rest, count=1)
    if not table or count != 1:
        raise InputError(f"limits.{key}: the preset's file does not have it in a line of [limits]")
    return head + table + changed
