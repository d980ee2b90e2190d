"""The barriers that a decision is held against by branch and bound or by simulation."""

from __future__ import annotations

from enum import Enum


class Barrier(Enum):
    """A limit that must not be crossed, by the name that results give it."""

    CORE = "core"
    SURFACE = "surface"
    VOLTAGE = "voltage"
