"""Firmware that takes a part of the family for nominal, to show that each part is needed."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import Any

from bms.calibration.family_block import family_fields
from bms.presets import Preset

_EXACT = (1.0, 1.0)


class NominalPart(str, Enum):
    """What the firmware takes for that of the nominal cell, by its name on the command line."""

    RESISTANCE = "resistance"
    """Ohmic resistance and polarisation: heat is that of the nominal resistances at most."""
    ENTROPY = "entropy"
    """dU/dT: the mean over the state of charge, without error."""
    THERMAL = "thermal"
    """Resistances and heat capacities of core, surface and coolant."""


def nominal_fields(preset: Preset, part: NominalPart) -> dict[str, Any]:
    """family_constants_t for a family with one part exactly as in the nominal cell."""
    cell, interval = preset.cell, preset.cell.interval
    assert interval is not None
    if part is NominalPart.RESISTANCE:
        interval = replace(interval, resistance=_EXACT, polarisation=_EXACT)
    elif part is NominalPart.THERMAL:
        interval = replace(
            interval,
            core_resistance=_EXACT,
            core_heat_capacity=_EXACT,
            surface_resistance=_EXACT,
            surface_heat_capacity=_EXACT,
            coolant_heat_capacity=_EXACT,
        )
    else:
        interval = replace(interval, entropic_error_V_per_K=0.0)
        cell = replace(cell, entropy=None)
    return family_fields(replace(preset, cell=replace(cell, interval=interval)))
