"""The frames that the nodes of this project exchange."""

from __future__ import annotations

from typing import NamedTuple


class Frame(NamedTuple):
    """A data frame with an 11-bit identifier."""

    frame_id: int
    data: bytes
