"""Robust control barriers: constants of the four constraints and margins for sampling."""

from bms.barrier.constants import BarrierConstants, barrier_constants
from bms.barrier.margins import Margins, sampling_margins

__all__ = [
    "BarrierConstants",
    "Margins",
    "barrier_constants",
    "sampling_margins",
]
