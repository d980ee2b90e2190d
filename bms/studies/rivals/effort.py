"""How long the rivals that need iterations are fitted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Starts and steps of the perceptron, iterations and trees of the floor.

    Steps and iterations add up; after each of them validation data decide whether to keep it.
    """

    perceptron_starts: int
    perceptron_steps: tuple[int, ...]
    floor_iterations: tuple[int, ...]
    floor_trees: int


FULL = Effort(3, (10, 20, 70, 200, 700), (50, 100, 150, 300, 600), 600)
QUICK = Effort(1, (10, 20, 70), (50,), 50)
"""For a first look; the rivals are worse than they need be."""
