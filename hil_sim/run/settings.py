"""What determines a run: preset, controller, bus, seed, faults, times."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.faults import Fault
from hil_sim.plant.catalog import DEFAULT_PLANT
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.true_cell import TrueCell

ANSWER_TIMEOUT_S = 1.0


class ControllerKind(str, Enum):
    """Names on the command line: the firmware, and each of bms.baselines.BASELINES."""

    KAN_RCBF = "kan-rcbf"
    S_CBF = "s-cbf"
    S_CBF_SINGLE_STEP = "s-cbf-single-step"
    CC_CV = "cc-cv"
    MULTI_STAGE = "multi-stage"


def run_name(controller: str, mode: str | None) -> str:
    """What tells a run from others beside it: its controller, and the mode where one is asked."""
    return controller if mode is None else f"{controller}-{mode}"


@dataclass(frozen=True)
class Settings:
    """What determines a run. The delay is in control periods, the time limit from the edge.

    A run that does not end early goes on to the time limit whatever the ECU says.
    """

    preset: Preset
    controller: ControllerKind = ControllerKind.KAN_RCBF
    model: Path | KanModel | None = None
    bus: str = "virtual:bms"
    seed: int = 0
    disturbance: DisturbanceKind = DisturbanceKind.NONE
    charger_delay_periods: int = 0
    max_time_s: float = 3600.0
    realtime: bool = False
    answer_timeout_s: float = ANSWER_TIMEOUT_S
    faults: tuple[Fault, ...] = ()
    mode: Mode | None = None
    """How to charge; None leaves the message out that asks for it."""
    full_by_s: float | None = None
    """When to be full, in s from the edge, for Mode.BY_TIME."""
    ends_early: bool = True
    initial: Initial | None = None
    """State of the cell at the start; that of the preset without."""
    true_cell: TrueCell | None = None
    """The cell as it truly is, with its charger and sensors, in place of the preset's at `initial`.
    """
    plant: str = DEFAULT_PLANT
    """NAME or NAME:ARGUMENT of a plant, see hil_sim.plant.catalog."""

    @property
    def mode_name(self) -> str | None:
        """The mode as on the command line; None for a controller that has none.

        A charger that does not ask for one gets the fastest charge.
        """
        if self.controller is not ControllerKind.KAN_RCBF:
            return None
        return (Mode.FASTEST if self.mode is None else self.mode).label.replace("_", "-")

    @property
    def name(self) -> str:
        """Name of the run, see `run_name`."""
        return run_name(self.controller.value, self.mode_name)
