"""What every estimator of the comparison offers, and the data that it is run on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bms.arrays import Array, Float32Array
from bms.data.simulate import Samples
from bms.kan.network import INPUT_NAMES

Rows = Float32Array
Starts = npt.NDArray[np.uint32]

BASE_COLUMNS = tuple(range(len(INPUT_NAMES)))
FLOAT32_BYTES = 4


@dataclass(frozen=True)
class Cost:
    """What one estimate costs in float32 C.

    `parameters` are the numbers that were fitted or have to be known of the cell, `bytes` those of
    constants and state, `multiply_adds` the multiplications of an estimate with the addition that
    follows; divisions and tanh are not among them.
    """

    parameters: int
    bytes: int
    multiply_adds: int


class Estimator(Protocol):
    """An estimator of the core temperature.

    `columns` are the inputs that it takes, `given` what it knows; without cost it is not in C.
    """

    @property
    def name(self) -> str: ...
    @property
    def given(self) -> str: ...
    @property
    def columns(self) -> tuple[int, ...]: ...
    @property
    def cost(self) -> Cost | None: ...

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,) for contiguous inputs (N, len(columns)).

        Profile p has the rows starts[p] to starts[p + 1] - 1 in order of time.
        """
        ...


@dataclass(frozen=True)
class Sequences:
    """Samples profile after profile: inputs (N, n); core temperature in K and time in s (N,)."""

    inputs: Rows
    starts: Starts
    core_temperature_K: Array
    time_s: Array

    @classmethod
    def of(cls, samples: Samples) -> Sequences:
        """The samples sorted by profile, in order of time within each."""
        order = np.argsort(samples.profile, kind="stable")
        changes = np.flatnonzero(np.diff(samples.profile[order])) + 1
        return cls(
            samples.inputs[order].astype(np.float32),
            np.array([0, *changes, len(order)], dtype=np.uint32),
            samples.core_temperature_K[order],
            samples.time_s[order],
        )

    def head(self, rows: int) -> Sequences:
        """The first whole profiles, at least one, until `rows` rows are reached."""
        profiles = max(1, int(np.searchsorted(self.starts, rows, side="right")) - 1)
        profiles = min(profiles, len(self.starts) - 1)
        end = int(self.starts[profiles])
        return Sequences(
            self.inputs[:end],
            self.starts[: profiles + 1],
            self.core_temperature_K[:end],
            self.time_s[:end],
        )

    def of_columns(self, columns: tuple[int, ...]) -> Rows:
        """Contiguous inputs (N, len(columns))."""
        return np.ascontiguousarray(self.inputs[:, list(columns)])
