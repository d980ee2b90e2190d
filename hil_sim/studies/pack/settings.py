"""What determines a study of packs, and with it every number of its result."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any

from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.presets import Preset
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.spread import Spread, Surroundings

CHUNK_PACKS = 4
"""Packs that a worker does in one piece."""


@dataclass(frozen=True)
class PackSettings:
    """Packs to charge. Raises InputError for numbers of cells or packs that cannot be."""

    preset: Preset
    model: KanModel
    cells: int = 16
    packs: int = 1000
    seed: int = 0
    max_time_s: float = 3600.0
    disturbed: bool = True
    spread: Spread = field(default_factory=Spread)
    around: Surroundings = field(default_factory=Surroundings)

    def __post_init__(self) -> None:
        most = lib.BMS_MAX_FAMILY_CELLS if self.is_family else lib.BMS_MAX_CELLS
        if not 1 <= self.cells <= most:
            raise InputError(f"--cells {self.cells}: from 1 to {most} cells fit into a pack")
        if self.packs < 1:
            raise InputError(f"--packs {self.packs}: at least 1 is needed")

    @property
    def is_family(self) -> bool:
        """Whether the preset states a family, from which the cells are drawn."""
        return self.preset.cell.interval is not None

    def identity(self) -> dict[str, Any]:
        """Everything that the results depend on, as plain JSON."""
        source_hash: bytes = ffi.string(lib.native_source_hash())
        return {
            "preset": self.preset.name,
            "preset_hash": self.preset.hash,
            "model_hash": self.model.hash,
            "source_hash": source_hash.decode(),
            "cells": self.cells,
            "packs": self.packs,
            "seed": self.seed,
            "max_time_s": self.max_time_s,
            "disturbed": self.disturbed,
            "drawn_from": "family" if self.is_family else "spread",
            "spread": asdict(self.spread),
            "surroundings": asdict(self.around),
        }

    @property
    def hash(self) -> str:
        """SHA-256 of the identity, as hexadecimal text."""
        return hashlib.sha256(json.dumps(self.identity(), sort_keys=True).encode()).hexdigest()

    def chunks(self) -> list[range]:
        """The packs in pieces of CHUNK_PACKS."""
        starts = range(0, self.packs, CHUNK_PACKS)
        return [range(first, min(first + CHUNK_PACKS, self.packs)) for first in starts]
