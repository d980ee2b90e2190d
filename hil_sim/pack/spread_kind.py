"""How the cells of a pack differ, by the word that a command takes for it."""

from __future__ import annotations

from enum import Enum


class SpreadKind(str, Enum):
    """How the cells of a pack differ."""

    PUBLISHED = "published"
    NONE = "none"
