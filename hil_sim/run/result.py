"""What a run leaves behind: time series and the summary with stable keys."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from bms.cell import CellState
from bms.firmware import ReceptionCounts
from hil_sim.bus.catalog import CommandState
from hil_sim.faults.injection import InjectedFault
from hil_sim.nodes.line_losses import LineLosses
from hil_sim.nodes.plant import Answer
from hil_sim.nodes.punctuality import PlantWatch, Timing
from hil_sim.plant.catalog import DEFAULT_PLANT
from hil_sim.run.settings import run_name


@dataclass
class TimeSeries:
    """One entry a control period of period_s; the time is 0 at the start of the charge.

    Temperatures and state of charge are true values at the start of the period, current and
    voltage those that the charger applies from then on. The estimate is None where the ECU gave
    none.
    """

    period_s: float
    charge_period: list[int | None] = field(default_factory=list)
    """Number of the period, 0 at the start of the charge; None before that."""
    time_s: list[float] = field(default_factory=list)
    current_A: list[float] = field(default_factory=list)
    voltage_V: list[float] = field(default_factory=list)
    soc: list[float] = field(default_factory=list)
    core_temperature_K: list[float] = field(default_factory=list)
    surface_temperature_K: list[float] = field(default_factory=list)
    coolant_temperature_K: list[float] = field(default_factory=list)
    command_A: list[float | None] = field(default_factory=list)
    usable_command_A: list[float | None] = field(default_factory=list)
    """What of it the charger may use."""
    estimated_core_temperature_K: list[float | None] = field(default_factory=list)
    estimated_soc: list[float | None] = field(default_factory=list)
    state: list[str | None] = field(default_factory=list)
    active_constraint: list[str | None] = field(default_factory=list)
    feasible: list[bool | None] = field(default_factory=list)
    latched_faults: list[int | None] = field(default_factory=list)
    planned_A: list[float | None] = field(default_factory=list)
    predicted_time_to_full_s: list[float | None] = field(default_factory=list)
    """These two only in the periods in which the ECU told them."""

    def append(
        self,
        charge_period: int | None,
        time_s: float,
        state: CellState,
        current_A: float,
        voltage_V: float,
        answer: Answer,
    ) -> None:
        """Add a period: what is true at its start, and what the ECU answered."""
        self.charge_period.append(charge_period)
        self.time_s.append(time_s)
        self.current_A.append(current_A)
        self.voltage_V.append(voltage_V)
        self.soc.append(state.soc)
        self.core_temperature_K.append(state.core_temperature_K)
        self.surface_temperature_K.append(state.surface_temperature_K)
        self.coolant_temperature_K.append(state.coolant_temperature_K)
        self.command_A.append(answer.command_A)
        self.usable_command_A.append(answer.usable_command_A)
        self.estimated_core_temperature_K.append(answer.value("CoreTemperature"))
        self.estimated_soc.append(answer.value("StateOfCharge"))
        self.state.append(answer.state)
        self.active_constraint.append(answer.active_constraint)
        self.feasible.append(answer.feasible)
        self.latched_faults.append(answer.latched_faults)
        self.planned_A.append(answer.value("PlannedCurrent"))
        self.predicted_time_to_full_s.append(answer.value("PredictedTimeToFull"))


@dataclass(frozen=True)
class Summary:
    """Figures of a run. The first thirteen are a stable interface; None where there is none."""

    controller: str
    preset: str
    bus: str
    steps: int
    max_core_temperature_K: float
    max_surface_temperature_K: float
    max_voltage_V: float
    final_soc: float
    charge_time_s: float | None
    first_derate_s: float | None
    kan_rmse_K: float | None
    kan_max_abs_error_K: float | None
    wall_time_s: float
    max_soc: float
    limits_kept: bool
    violations: tuple[str, ...]
    stop_reason: str
    first_fault: int | None
    infeasible_steps: int
    error_bound_K: float | None
    seed: int
    disturbance: str
    realtime: bool
    model_hash: str | None
    preset_hash: str
    command_reception: ReceptionCounts
    """Charge commands that the charger refused, or missed as far as the next counter shows."""
    faults: tuple[InjectedFault, ...] = ()
    timing: Timing | None = None
    line_losses: LineLosses | None = None
    """Frames lost on the serial line to the ECU; None where there is no such line."""
    plant: str = DEFAULT_PLANT
    min_anode_potential_V: float | None = None
    """Least over the run; None where the plant has no electrodes."""
    mean_core_temperature_K: float | None = None
    """Over the charge; None where none began."""
    heat_J: float | None = None
    """Produced by the cell over the run; None where the plant does not tell it."""
    optimum_time_s: float | None = None
    """Time to full that no controller can beat, by physics alone; None where it is not known."""
    time_over_optimum: float | None = None
    """The charge's time over that."""
    lower_bound_s: float | None = None
    """The same with the preset's ramp and current map."""
    time_over_bound: float | None = None
    mode: str | None = None
    """What the charger asked for; None where it left the message out."""
    full_by_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain mapping in the order of the fields."""
        content = asdict(self)
        return {**content, "violations": list(self.violations), "faults": list(content["faults"])}

    @property
    def name(self) -> str:
        """What tells this run from others beside it, see hil_sim.run.settings.run_name."""
        return run_name(self.controller, self.mode)

    @property
    def failures(self) -> list[str]:
        """What is wrong with the run, one text each."""
        reasons = list(self.violations)
        if self.line_losses is not None and self.line_losses.total:
            reasons.append(str(self.line_losses))
        if self.stop_reason not in (STOP_COMPLETE, STOP_TIME_LIMIT):
            fault = "" if self.first_fault is None else f" {self.first_fault} (monitor.h)"
            reasons.append(f"run ended by {self.stop_reason}{fault}")
        return reasons

    @property
    def shortfall(self) -> str | None:
        """How full the cell is where time ended before the charge did; None where it did not."""
        if self.stop_reason != STOP_TIME_LIMIT:
            return None
        return f"time ended before the charge: state of charge {100.0 * self.final_soc:.2f} %"

    @property
    def passed(self) -> bool:
        """Whether every limit was kept and the charge did not end in a fault or in silence."""
        return not self.failures


STOP_COMPLETE, STOP_TIME_LIMIT = "complete", "time-limit"
STOP_FAULT, STOP_SILENT = "fault", "ecu-silent"

DERATED_STATE = CommandState.DERATED.label
CHARGING_STATES = (CommandState.CHARGING.label, DERATED_STATE)


@dataclass(frozen=True)
class RunResult:
    """A finished run: its figures, its course and how punctual it was."""

    summary: Summary
    series: TimeSeries
    watch: PlantWatch | None = None
    """Every time behind the summary's timing; None where time was virtual."""
