"""What a training run can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, MinLen

from bms.data.lags import Lag, Lags
from bms.errors import InputError
from bms.validation import Count, NonNegative, Positive, strict

PRESET_LAGS_S = (3.0,)
"""Time constants of a lagged network that is trained on simulated data."""


@strict
@dataclass(frozen=True)
class TrainingSettings:
    """Shape of the network and hyper-parameters; the defaults are the paper's table.

    Where there is one hidden node an additive fit stands in place of the epochs. At most
    `refinement_steps` L-BFGS steps without penalties follow; the paper has none. Every time
    constant adds two lagged inputs, of the current squared and of the surface temperature. Raises
    InputError for a width that does not end in one output.
    """

    width: Annotated[tuple[Count, ...], MinLen(2)] = (4, 1, 1)
    grid: Count = 2
    degree: Count = 3
    epochs: Annotated[int, Ge(0)] = 70
    grid_update_stop: Annotated[int, Ge(0)] = 50
    batch: Count = 2**14
    regularisation: NonNegative = 5e-5
    l1_penalty: NonNegative = 0.14
    entropy_penalty: NonNegative = 0.17
    refinement_steps: Annotated[int, Ge(0)] = 80
    seed: Annotated[int, Ge(0)] = 0
    lag_time_constants_s: tuple[Positive, ...] = ()

    def __post_init__(self) -> None:
        if self.width[-1] != 1:
            raise InputError("width: must end in 1, the core temperature")

    @property
    def lags(self) -> Lags:
        """Lagged inputs in the network's order."""
        return (
            *(Lag("current_squared_A2", constant_s) for constant_s in self.lag_time_constants_s),
            *(
                Lag("surface_temperature_rise_K", constant_s)
                for constant_s in self.lag_time_constants_s
            ),
        )

    @property
    def has_one_hidden_node(self) -> bool:
        """Whether the network is an outer function of a sum, as [4, 1, 1] is."""
        return self.width[1:] == (1, 1)
