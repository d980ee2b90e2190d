"""One data set to compare estimators on, with all that the rivals are told."""

from __future__ import annotations

from dataclasses import dataclass

from bms.arrays import Mask
from bms.cell import CellParameters
from bms.data.lags import Lags
from bms.data.simulate import Samples
from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.thermal import FilterNoise


@dataclass(frozen=True)
class Problem:
    """Data to fit to and to test on, and what the filters know.

    What validation data must choose, such as when to stop, is fitted to `before_validation`, which
    with them is within `training` or is all of it. The floor may choose by `floor_choice`.
    `scopes` are masks over the test rows; `counted` is the one that figures are compared on.
    `read` is the test as the sensors show it, None when it consists of readings anyway. `lags` are
    the inputs after the first four.
    `tuned` is for a filter fitted to the training data as a whole, where there is no true cell.
    `resistance_start` is what the extended filter assumes of R0 at first, over the cell's.
    """

    title: str
    training: Samples
    before_validation: Samples
    validation: Samples
    floor_choice: Samples
    floor_chosen_by: str
    test: Sequences
    scopes: dict[str, Mask]
    counted: str
    read: Sequences | None
    lags: Lags
    cell: CellParameters
    cell_origin: str
    noise: FilterNoise
    tuned: tuple[CellParameters, FilterNoise] | None
    period_s: float
    resistance_start: float
    trace_profile: int
    trace_title: str
