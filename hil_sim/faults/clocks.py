"""Faults of timing, which exist in real time only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Le

from bms.validation import strict
from hil_sim.faults.base import Fault
from hil_sim.nodes.clock import Clock

_MS_PER_S = 1000.0


@strict
@dataclass(frozen=True, kw_only=True)
class ClockJitter(Fault):
    """The plant begins each period late, by a time that is evenly distributed up to late_ms."""

    kind: Literal["clock-jitter"]
    late_ms: Annotated[float, Gt(0.0), Le(10_000.0)]

    needs_realtime = True

    @property
    def where(self) -> str:
        """The plant's clock, in words."""
        return "plant's clock"

    def wait(self, clock: Clock, rng: np.random.Generator) -> None:
        """Let the time pass by which this period is late."""
        clock.sleep_until_s(clock.now_s() + float(rng.uniform(0.0, self.late_ms)) / _MS_PER_S)


CLOCK_FAULTS = (ClockJitter,)
