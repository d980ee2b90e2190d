"""The argument of `bms verify` for a preset that speaks for a family of cells."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from bms.firmware.calibration import calibration_block
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.verification.family_constants import Relation, relations
from bms.verification.family_coolant import warmest_coolant_K
from bms.verification.family_lies import Lie, worst_lies
from bms.verification.family_search import SAMPLES, Violation, search_family

FAMILY_PARTS = 2


@dataclass(frozen=True)
class FamilyVerification:
    """What was shown for every cell of a preset's family; `certified` when nothing fails.

    `relations` are what the derivation needs of the firmware's constants, `violations` what was
    found against its claims by simulated holds, `lies` what one wrong sensor can do unseen.
    `coolant_up_to_K` is where no disturbance reaches a limit at 0 A; a warmer one is not covered.
    """

    preset: str
    model: str
    held_s: float
    relations: tuple[Relation, ...]
    samples: int
    violations: tuple[Violation, ...]
    lies: tuple[Lie, ...]
    coolant_up_to_K: float
    wall_time_s: float

    @property
    def certified(self) -> bool:
        """Whether every relation holds and no simulated hold contradicts a claim."""
        return all(relation.holds for relation in self.relations) and not self.violations

    def as_dict(self) -> dict[str, Any]:
        """Content for JSON: plain numbers, lists and mappings."""
        return {
            "preset": self.preset,
            "model": self.model,
            "family": True,
            "certified": self.certified,
            "held_s": self.held_s,
            "relations": [{**asdict(r), "holds": r.holds} for r in self.relations],
            "samples": self.samples,
            "violations": [asdict(violation) for violation in self.violations],
            "single_sensor_lies": [asdict(lie) for lie in self.lies],
            "coolant_up_to_K": self.coolant_up_to_K,
            "wall_time_s": self.wall_time_s,
        }


def verify_family(
    preset: Preset,
    model: KanModel,
    samples: int = SAMPLES,
    note: Callable[[str], None] = lambda part: None,
) -> FamilyVerification:
    """Check the constants against the intervals, and search for a cell that crosses a limit.

    `note` is told which of FAMILY_PARTS comes next. Raises what loading the calibration raises.
    """
    begin = time.monotonic()
    block = calibration_block(preset, model, compiled_in=False)
    note("constants of the family")
    needed = tuple(relations(preset, block))
    lies = tuple(worst_lies(preset, block))
    note("cells of the family")
    violations = search_family(preset, block, samples)
    return FamilyVerification(
        preset=preset.name,
        model=model.hash[:8],
        held_s=float(block.family.hold_s),
        relations=needed,
        samples=samples,
        violations=violations,
        lies=lies,
        coolant_up_to_K=warmest_coolant_K(preset),
        wall_time_s=time.monotonic() - begin,
    )
