"""How long computations say how far they are, whoever listens."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], None]
"""Is told the share that is done, 0..1."""


def to_nobody(share: float) -> None:
    """Progress that is not followed."""


def part(progress: Progress, begin: float, end: float) -> Progress:
    """Progress of one part of a computation, from share `begin` of the whole to share `end`."""
    return lambda share: progress(begin + (end - begin) * share)
