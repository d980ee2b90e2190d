"""Lower bounds on the time to full of the shipped presets' own charges, computed beforehand.

`python -m bms.studies.optimum` writes the file; docs/optimum.md says what the bounds are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bms.presets.digest import digest, plain
from bms.presets.schema import Preset
from bms.validation import Positive, parse, read_json, strict

KNOWN_BOUNDS = Path(__file__).parent / "optimum.json"


@strict
@dataclass(frozen=True)
class KnownBound:
    """No controller fills the preset's nominal cell from its own start in less time, in s.

    `optimum_time_s` is physics alone, `lower_bound_s` has the preset's ramp and current map too.
    `charge` is what they belong to, as hexadecimal text.
    """

    charge: str
    optimum_time_s: Positive
    lower_bound_s: Positive


@strict
@dataclass(frozen=True)
class KnownBounds:
    """The file: how it was made, and a bound by the name of each preset."""

    made_by: str
    samples: int
    presets: dict[str, KnownBound]


def known_bound(preset: Preset) -> KnownBound | None:
    """The bound of a preset, None where none is known for its cell, limits and start as they are.

    Raises InputError when the file is damaged.
    """
    charge = charge_digest(preset)
    return next((one for one in _known().presets.values() if one.charge == charge), None)


def charge_digest(preset: Preset) -> str:
    """Hash of all that a bound depends on: nominal cell, limits, start, map and period."""
    cell = plain(preset.cell)
    cell.pop("interval", None)
    return digest(
        {
            "cell": cell,
            "limits": preset.limits,
            "initial": preset.initial,
            "current_map": preset.current_map,
            "sampling_period_s": preset.timing.sampling_period_s,
        }
    )


@cache
def _known() -> KnownBounds:
    return parse(KnownBounds, read_json(KNOWN_BOUNDS), str(KNOWN_BOUNDS))
