"""Every float32 there is through every edge of the firmware, against the double-precision edge.

An edge is a function of one float32, so that all its 2^32 arguments can be tried: numbers within
the grid, beyond it, signed zeros, denormals, infinities and NaNs of every payload.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache, reduce
from itertools import chain

import numpy as np
import numpy.typing as npt

from bms.arrays import Array, Mask
from bms.firmware.edges import CompiledEdges
from bms.kan.network import Edge, Network
from bms.progress import to_nobody
from bms.tables.network_tables import network_tables

PATTERNS = 2**32
_BLOCK = 2**16
_PART = 2**27
_NEIGHBOURS = 64
_SIGN = 0x8000_0000
_FACE_TOLERANCE = float(np.float32(1e-6))
"""KAN_FACE_TOLERANCE of the firmware: arguments this far beyond the grid count as on its end."""
_ROUND_OFF_BITS = 57.0

Patterns = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class EdgeCheck:
    """Result for one edge: worst |C - double| in the unit of its value, and where; domain flags."""

    edge: int
    arguments: int
    worst_error: float
    worst_argument: float
    wrong_flags: int
    wrong_flag_argument: float | None

    def joined(self, other: EdgeCheck) -> EdgeCheck:
        """Result over the arguments of both."""
        worse = self if self.worst_error >= other.worst_error else other
        flagged = self if self.wrong_flags else other
        return EdgeCheck(
            self.edge,
            self.arguments + other.arguments,
            worse.worst_error,
            worse.worst_argument,
            self.wrong_flags + other.wrong_flags,
            flagged.wrong_flag_argument,
        )


class EdgeSweep:
    """One edge of a network in C, beside the same edge in double precision."""

    def __init__(
        self, network: Network, number: int, compiled: CompiledEdges | None = None
    ) -> None:
        """`compiled` are the edges to check, none: those of the network itself.

        Raises InputError when the network exceeds the firmware's maxima.
        """
        self._number = number
        self._degree = network.degree
        self._edge: Edge = network.edges[number]
        self._compiled = CompiledEdges(network) if compiled is None else compiled
        self._knots = np.asarray(self._edge.knots[network.degree : -network.degree])
        self._end_values = self._edge.evaluate(self._knots[[0, -1]], self._degree)[0]
        self._table_knots = network_tables(network).edges[number].knots

    def check_all(self, first: int, last: int) -> EdgeCheck:
        """Check of all bit patterns from first to before last."""
        return _joined(
            self._check(np.arange(at, min(at + _BLOCK, last), dtype=np.uint32), self.reference)
            for at in range(first, last, _BLOCK)
        )

    def check_some(self, stride: int) -> EdgeCheck:
        """Check of every stride-th bit pattern, special values and the neighbours of all knots."""
        parts = [np.arange(0, PATTERNS, stride).astype(np.uint32), _special_patterns()]
        corners = np.concatenate([self._knots, self._table_knots])
        ends = self._table_knots[[0, -1]] + [-_FACE_TOLERANCE, _FACE_TOLERANCE]
        for corner in np.concatenate([corners, ends]).astype(np.float32).view(np.uint32):
            around = np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1) + int(corner)
            parts.append((around % PATTERNS).astype(np.uint32))
        return self._check(np.concatenate(parts), self.exact)

    def exact(self, x: Array) -> Array:
        """Double-precision edge at x (N,); the lower end's value for NaN, as in the firmware."""
        return np.where(np.isnan(x), self._end_values[0], self._edge.evaluate(x, self._degree)[0])

    def reference(self, x: Array) -> Array:
        """The same for a run of neighbouring float32 numbers, quicker.

        Between knots the edge is interpolated at Chebyshev nodes, with less than 1e-13 of error;
        where it is constant the result has shape (1,).
        """
        ends_unknown = np.isnan(x[[0, -1]])
        if ends_unknown.any():
            return self._end_values[:1] if ends_unknown.all() else self.exact(x)
        low, high = sorted((float(x[0]), float(x[-1])))
        if high < self._knots[0]:
            return self._end_values[:1]
        if low > self._knots[-1]:
            return self._end_values[1:]
        can_be_interpolated = 0.0 < high - low < 1.0
        if not can_be_interpolated or np.any((self._knots >= low) & (self._knots <= high)):
            return self.exact(x)
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        nodes, to_powers = _interpolation(max(_order(half), self._degree))
        powers = to_powers @ self._edge.evaluate(middle + half * nodes, self._degree)[0]
        distance = (x - middle) / half
        value = np.full_like(x, powers[-1])
        for power in powers[-2::-1]:
            value *= distance
            value += power
        return value

    def _check(self, patterns: Patterns, reference: Callable[[Array], Array]) -> EdgeCheck:
        x = patterns.view(np.float32)
        values, flags = np.empty(len(x), np.float32), np.empty(len(x), np.uint8)
        self._compiled.evaluate(self._number, x, values, flags)
        with np.errstate(invalid="ignore"):  # arguments that are NaN
            wide = x.astype(np.float64)
            error = np.abs(values - reference(wide))
            inside = self._inside(wide)
        worst = int(np.argmax(error))
        wrong = np.flatnonzero(flags.astype(np.bool_) != inside)
        return EdgeCheck(
            self._number,
            len(x),
            # A value that is no number is as wrong as can be.
            float(error[worst]) if np.isfinite(error[worst]) else np.inf,
            float(x[worst]),
            len(wrong),
            float(x[wrong[0]]) if len(wrong) else None,
        )

    def _inside(self, x: Array) -> Mask:
        beyond_low = self._table_knots[0] - x <= _FACE_TOLERANCE
        beyond_high = x - self._table_knots[-1] <= _FACE_TOLERANCE
        return np.asarray(beyond_low & beyond_high)


def check_network(
    network: Network, stride: int, processes: int, advance: Callable[[float], None] = to_nobody
) -> list[EdgeCheck]:
    """Check of every edge: of all arguments (stride 1), or of each stride-th and special ones.

    An odd stride lets all bits of the argument vary. `advance` gets the share that a part of the
    work has had of the whole. Raises InputError when the network exceeds the firmware's maxima.
    """
    numbers = range(len(network.edges))
    if stride > 1:
        checks = []
        for number in numbers:
            checks.append(EdgeSweep(network, number).check_some(stride))
            advance(1.0 / len(numbers))
        return checks
    firsts = range(0, PATTERNS, _PART)
    with ProcessPoolExecutor(processes) as pool:
        parts = [[pool.submit(_check_part, network, n, first) for first in firsts] for n in numbers]
        for _ in as_completed(chain.from_iterable(parts)):
            advance(1.0 / (len(numbers) * len(firsts)))
        return [_joined(part.result() for part in edge) for edge in parts]


def _check_part(network: Network, number: int, first: int) -> EdgeCheck:
    return EdgeSweep(network, number).check_all(first, first + _PART)


def _order(half: float) -> int:
    """Order of interpolation at which what silu leaves over a half width is below round-off.

    The nearest singularity of silu is pi away, so that each order gains a factor of half/4.
    """
    return int(np.ceil(_ROUND_OFF_BITS / np.log2(4.0 / half))) - 1


@cache
def _interpolation(order: int) -> tuple[Array, Array]:
    """Chebyshev nodes in -1..1 and the matrix from values at them to powers of the argument."""
    nodes = np.cos(np.pi * (np.arange(order + 1) + 0.5) / (order + 1))
    return nodes, np.linalg.inv(np.vander(nodes, increasing=True))


def _special_patterns() -> Patterns:
    """Zeros, denormals, all powers of two, the largest numbers, infinities and NaNs, both signs."""
    powers = np.arange(256, dtype=np.int64) << 23
    near = np.arange(-2, 3)
    positive = np.concatenate(
        [
            (powers[:, None] + near).ravel(),
            0x7F80_0000 + (1 << np.arange(23)),
            1 << np.arange(23),
        ]
    )
    positive = positive[(positive >= 0) & (positive < _SIGN)]
    return np.concatenate([positive, positive + _SIGN]).astype(np.uint32)


def _joined(checks: Iterable[EdgeCheck]) -> EdgeCheck:
    return reduce(EdgeCheck.joined, checks)
