"""What determines a campaign, and with it every byte of its runs.csv."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.presets import Preset
from hil_sim.bus.catalog import Mode
from hil_sim.studies.campaign.nominal import NominalPart

CHUNK_RUNS = 20
"""Runs that a worker does in one piece and that are stored together; about a second of work."""


class CellFamily(str, Enum):
    """Which cells are drawn, by the name on the command line."""

    PUBLISHED = "published"
    """In the published intervals of core and surface, in equilibrium, known state of charge."""
    REAL = "real"
    """All that the preset's intervals, plug-in errors, supply and disturbance admit."""


MAX_TIME_S = {CellFamily.PUBLISHED: 3600.0, CellFamily.REAL: 10_800.0}
"""Time limit of a charge unless another is given, at least; cold cells are charged slowly."""
_OVER_MAP = 1.1
"""Of the time that the weakest current of a preset's map takes from empty to full."""


def default_max_time_s(preset: Preset, family: CellFamily) -> float:
    """Time limit in s of a charge unless another is given.

    A cell that stays at the cold end of its range gets no more than the weakest current of its
    preset's map, which no charge control could shorten.
    """
    least_s, interval, chosen = MAX_TIME_S[family], preset.cell.interval, preset.current_map
    if family is not CellFamily.REAL or interval is None or chosen is None:
        return least_s
    currents_A = [current_A for row in chosen.largest_A for current_A in row if current_A > 0.0]
    if not currents_A:
        return least_s
    longest_s = interval.capacity[1] * preset.cell.capacity_As / min(currents_A)
    return max(least_s, float(math.ceil(_OVER_MAP * longest_s)))


@dataclass(frozen=True)
class CampaignSettings:
    """A campaign. `firmware_changes` sets constants of the firmware to other values, for studies.

    Raises InputError when there is nothing to run, or no family to draw from.
    """

    preset: Preset
    model: KanModel
    runs: int
    seed: int = 0
    max_time_s: float = 3600.0
    firmware_changes: Mapping[str, float] = field(default_factory=dict)
    family: CellFamily = CellFamily.PUBLISHED
    nominal_part: NominalPart | None = None
    """Part of the family that the firmware takes for nominal, though the cells are not."""
    mode: Mode | None = None
    """How the firmware is asked to charge; None leaves the message out that asks for it."""

    def __post_init__(self) -> None:
        if self.runs < 1:
            raise InputError(f"campaign of {self.runs} runs: at least 1 is needed")
        if self.family is CellFamily.REAL and self.preset.cell.interval is None:
            raise InputError(
                f"preset '{self.preset.name}': has no [cell.interval], so there is no family to "
                "draw from; leave out --family real or choose a preset with one"
            )
        if self.mode is Mode.BY_TIME:
            raise InputError("campaign: mode by-time has no time; choose fastest or fixed")
        if self.nominal_part is not None and self.family is not CellFamily.REAL:
            raise InputError("--nominal-part: only --family real has parts; add it")

    def identity(self) -> dict[str, Any]:
        """Everything that the results depend on, as plain JSON; stored beside them."""
        identity = {
            "preset": self.preset.name,
            "preset_hash": self.preset.hash,
            "model_hash": self.model.hash,
            "runs": self.runs,
            "seed": self.seed,
            "max_time_s": self.max_time_s,
            "firmware_changes": dict(self.firmware_changes),
            "family": self.family.value,
            "nominal_part": None if self.nominal_part is None else self.nominal_part.value,
        }
        if self.mode is not None:
            # Left out without, so that folders of campaigns without a mode stay theirs.
            identity["mode"] = self.mode.label
        return identity

    @property
    def hash(self) -> str:
        """SHA-256 of the identity, as hexadecimal text."""
        return hashlib.sha256(json.dumps(self.identity(), sort_keys=True).encode()).hexdigest()

    def chunks(self) -> list[range]:
        """The runs in pieces of CHUNK_RUNS."""
        starts = range(0, self.runs, CHUNK_RUNS)
        return [range(start, min(start + CHUNK_RUNS, self.runs)) for start in starts]
