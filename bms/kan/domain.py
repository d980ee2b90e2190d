"""Combinations of inputs that training has seen.

Each input may lie in its trained range while all of them together describe a cell that cannot be:
a cold surface after minutes of full current. Training data fill a flat body in the box; the domain
is the narrowest parallelepiped around it whose sides follow their principal directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array, Mask
from bms.errors import InputError
from bms.validation import Finite, strict

_MARGIN = 0.3
_LEAST_MARGIN = 0.15
_LEAST_RANGE = 0.5


@strict
@dataclass(frozen=True)
class Domain:
    """Slabs low <= directions @ x <= high for normalised inputs x; directions (n, n_in).

    Raises InputError when shapes differ or a slab is empty.
    """

    directions: tuple[tuple[Finite, ...], ...] = ()
    low: tuple[Finite, ...] = ()
    high: tuple[Finite, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.directions) == len(self.low) == len(self.high):
            raise InputError("domain: directions, low and high differ in length")
        if len({len(direction) for direction in self.directions}) > 1:
            raise InputError("domain: directions differ in length")
        if any(high <= low for low, high in zip(self.low, self.high)):
            raise InputError("domain: every low must be below its high")

    def contains(self, x: Array) -> Mask:
        """Whether normalised inputs (N, n_in) lie within all slabs, (N,)."""
        if not self.directions:
            return np.ones(len(x), dtype=np.bool_)
        along = x @ np.asarray(self.directions).T
        inside = (along >= np.asarray(self.low)) & (along <= np.asarray(self.high))
        return np.asarray(np.all(inside, axis=1))


EVERYWHERE = Domain()


def domain_of(x: Array) -> Domain:
    """Domain of normalised training inputs (N, n_in), with a margin of 30 % of each width.

    What is flagged ends a charge, so the margin is wide enough for profiles that training has not
    seen, and no less than sensor errors need. Inputs that hardly vary have no part in the
    directions: how far they may go, the box says.
    """
    varying = np.flatnonzero(np.ptp(x, axis=0) >= _LEAST_RANGE)
    if not len(varying):
        return EVERYWHERE
    centred = x[:, varying] - x[:, varying].mean(axis=0)
    _, inner = np.linalg.eigh(centred.T @ centred)
    directions = np.zeros((x.shape[1], len(varying)))
    directions[varying] = inner
    # An eigenvector's sign is arbitrary; its largest component is made positive.
    directions = directions * np.sign(
        directions[np.abs(directions).argmax(axis=0), range(len(varying))]
    )
    along = x @ directions
    low, high = along.min(axis=0), along.max(axis=0)
    margin = np.maximum(_MARGIN * (high - low), _LEAST_MARGIN)
    return Domain(
        tuple(map(tuple, directions.T.tolist())),
        tuple((low - margin).tolist()),
        tuple((high + margin).tolist()),
    )
