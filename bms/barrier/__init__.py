"""Robust control barriers: constants of the four constraints and margins for sampling."""

from bms.barrier.constants import BarrierConstants, barrier_constants
from bms.barrier.margins import Margins, sampling_margins
from bms.barrier.readings import BUS, BusQuantisation

__all__ = [
    "BUS",
    "BarrierConstants",
    "BusQuantisation",
    "Margins",
    "barrier_constants",
    "sampling_margins",
]
