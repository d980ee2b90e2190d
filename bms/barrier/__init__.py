"""Robust control barriers: constants of the four constraints and margins for sampling."""

from bms.barrier.constants import BarrierConstants, barrier_constants
from bms.barrier.margins import BusQuantisation, Margins, sampling_margins

__all__ = [
    "BarrierConstants",
    "BusQuantisation",
    "Margins",
    "barrier_constants",
    "sampling_margins",
]
