"""One data set to compare estimators on, with all that the rivals are told."""

from __future__ import annotations

from dataclasses import dataclass

from bms.cell import CellParameters
from bms.data.simulate import Samples
from bms.kan.basis import Mask
from bms.kan.lags import Lags
from bms.rivals.estimator import Sequences
from bms.rivals.thermal import FilterNoise

ALL = "all"


@dataclass(frozen=True)
class Problem:
    """Data to fit to and to test on, and what the filters know.

    `scopes` are masks over the test rows, ALL among them; `read` is the test as the sensors show
    it, None when it consists of readings anyway. `lags` are the inputs after the first four.
    `resistance_start` is what the extended filter assumes of R0 at first, over the cell's.
    """

    title: str
    training: Samples
    validation: Samples
    test: Sequences
    scopes: dict[str, Mask]
    read: Sequences | None
    lags: Lags
    cell: CellParameters
    cell_origin: str
    noise: FilterNoise
    period_s: float
    resistance_start: float
    trace_profile: int
