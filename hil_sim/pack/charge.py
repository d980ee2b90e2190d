"""One charge of a pack over a bus: from plug-in until full, fault, silence or the time limit."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

from bms.errors import BusError, ModelMismatchError
from hil_sim.bus.buses import open_bus, require_room_for_ecu, require_shared
from hil_sim.bus.catalog import ActiveConstraint, CommandState, FirstFault
from hil_sim.bus.frame import Frame
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.ecu import EcuNode
from hil_sim.nodes.plant import Delivery
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.node import PackPlantNode
from hil_sim.pack.plant import PackPlant, PackWire, Tamper, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.run.result import STOP_COMPLETE, STOP_FAULT, STOP_SILENT, STOP_TIME_LIMIT
from hil_sim.studies.pack._pack import lib

OFF_PERIODS = 15
"""Periods with the request off: in 10 of them each page in turn has come at least once."""
READY_PERIODS = 2000
SILENT_PERIODS = 5
SAMPLE_PERIODS = 10
"""Periods between two columns of the heat map."""

Progress = Callable[[float], None]


@dataclass
class PackResult:
    """What came of a charge. Lists of samples have one entry for each SAMPLE_PERIODS."""

    settings: PackChargeSettings
    reason: str = ""
    steps: int = 0
    charge_periods: int = 0
    frames: int = 0
    wall_time_s: float = 0.0
    sample_s: list[float] = field(default_factory=list)
    current_A: list[float] = field(default_factory=list)
    core_K: list[list[float]] = field(default_factory=list)
    governor: list[int] = field(default_factory=list)
    """Cell that governed, from 1; 0 for none."""
    governed: dict[int, int] = field(default_factory=dict)
    """Periods in which each cell governed."""
    constraints: dict[str, int] = field(default_factory=dict)
    commands_A: list[float | None] = field(default_factory=list)
    """What the ECU commanded in each period since the start, None where it said nothing usable."""
    supplied_A: list[float] = field(default_factory=list)
    active_faults: list[int] = field(default_factory=list)
    first_fault: int = int(FirstFault.NONE)
    faulty_cell: int = 0
    latched: list[int] = field(default_factory=list)
    """Bit n for fault n, as the ECU has said last, in each period since the start."""
    latched_faults: int = 0
    """The same in the last period."""
    state: int = int(CommandState.FAULT)
    """What the ECU has said last."""
    edge: int | None = None
    """Period in which the charge was asked for."""
    full: int | None = None
    """Period in which the pack became full."""
    full_socs: list[float] = field(default_factory=list)
    peaks: Any = None
    least_anode_V: float | None = None
    final_socs: list[float] = field(default_factory=list)
    counted_soc: tuple[float, float] | None = None
    """What the ECU counted last of the emptiest and the fullest cell."""


def charge_pack(
    settings: PackChargeSettings,
    recorder: Recorder | None = None,
    progress: Progress = lambda soc: None,
    tamper: Tamper = lambda measured: None,
    sent: Delivery = list,
    ends_early: bool = True,
) -> PackResult:
    """Plant and ECU in this process and thread, on two connections to one bus.

    `tamper` and `sent` change what sensors read and what arrives. Raises InputError or BusError.
    """
    require_room_for_ecu(settings.bus)
    with ExitStack() as stack:
        ecu_bus = stack.enter_context(open_bus(settings.bus))
        plant_bus = stack.enter_context(open_bus(settings.bus))
        ecu = EcuNode(ecu_bus, PackEcu(settings))
        node = PackPlantNode(
            plant_bus,
            settings.preset.timing.sampling_period_s,
            settings.answer_timeout_s,
            lambda: ecu.answer(settings.answer_timeout_s),
            recorder,
            sent,
        )
        return _Run(settings, node, tamper, progress, ends_early).run()


def charge_pack_elsewhere(
    settings: PackChargeSettings,
    recorder: Recorder | None = None,
    progress: Progress = lambda soc: None,
) -> PackResult:
    """The plant alone, with a pack's ECU on the bus in another process.

    Raises InputError for a bus that no other process can be on, BusError when no ECU answers.
    """
    require_shared(settings.bus)
    with open_bus(settings.bus) as bus:
        period_s = settings.preset.timing.sampling_period_s
        node = PackPlantNode(bus, period_s, settings.answer_timeout_s, recorder=recorder)
        return _Run(settings, node, lambda measured: None, progress).run()


def _of_others(heard: list[Frame], published: list[Frame]) -> int:
    """Frames that are not this party's own, which some buses hand back to it."""
    own = {frame.frame_id for frame in published}
    return sum(frame.frame_id not in own for frame in heard)


class _Run:
    def __init__(
        self,
        settings: PackChargeSettings,
        node: PackPlantNode,
        tamper: Tamper,
        progress: Progress,
        ends_early: bool = True,
    ) -> None:
        self._settings, self._node, self._tamper = settings, node, tamper
        self._progress, self._ends_early = progress, ends_early
        self._plant = PackPlant(settings)
        self._wire = PackWire(settings, self._plant)
        self._result = PackResult(settings)
        self._silent_periods = 0
        self._fault_since: int | None = None

    def run(self) -> PackResult:
        result, plant, wire = self._result, self._plant, self._wire
        start_s = time.perf_counter()
        while not result.reason:
            plant.measure()
            self._tamper(plant)
            published = wire.publish(result.edge is not None)
            answer = self._node.exchange(result.steps, published)
            heard = wire.hear(answer)
            result.frames += len(published) + _of_others(answer, published)
            self._note(heard)
            result.steps += 1
            result.reason = self._stop_reason(heard)
            if not result.reason:
                self._prepare(heard)
                plant.bleed(heard)
                plant.hold(obeyed_A(heard))
        result.wall_time_s = time.perf_counter() - start_s
        result.peaks, result.final_socs = plant.peaks(), plant.socs()
        result.least_anode_V = plant.least_anode_V()
        return result

    def _note(self, heard: Any) -> None:
        result = self._result
        is_said = not math.isnan(heard.command_A)
        self._silent_periods = 0 if is_said else self._silent_periods + 1
        result.commands_A.append(float(heard.command_A) if is_said else None)
        result.supplied_A.append(self._plant.current_A)
        result.active_faults.append(int(heard.active_faults))
        result.latched_faults = int(heard.latched_faults)
        result.latched.append(result.latched_faults)
        if is_said:
            result.state = int(heard.state)
        if not math.isnan(heard.highest_soc):
            result.counted_soc = (float(heard.lowest_soc), float(heard.highest_soc))
        if heard.first_fault != FirstFault.NONE and result.first_fault == FirstFault.NONE:
            result.first_fault = int(heard.first_fault)
            result.faulty_cell = int(heard.faulty_cell)
        if result.edge is None:
            return
        since = result.steps - result.edge
        result.charge_periods = since
        if is_said and heard.governing_cell != 0:
            cell = int(heard.governing_cell)
            result.governed[cell] = result.governed.get(cell, 0) + 1
            name = ActiveConstraint(heard.constraint).label
            result.constraints[name] = result.constraints.get(name, 0) + 1
        if since % SAMPLE_PERIODS == 0:
            result.sample_s.append(since * self._settings.preset.timing.sampling_period_s)
            result.current_A.append(self._plant.current_A)
            result.core_K.append(self._plant.core_K())
            result.governor.append(int(heard.governing_cell) if is_said else 0)
            self._progress(max(self._plant.socs()))

    def _prepare(self, heard: Any) -> None:
        """Ask for the charge once the ECU is ready, not before OFF_PERIODS."""
        result = self._result
        if result.edge is not None or result.steps < OFF_PERIODS:
            return
        if heard.state == CommandState.STANDBY and heard.cells != 0:
            self._check_identity(heard)
            result.edge = result.steps
        elif result.steps >= READY_PERIODS or heard.state == CommandState.FAULT:
            raise BusError(
                f"the pack's ECU is not ready after {result.steps} periods (faults "
                f"0x{heard.active_faults:X}, cell {heard.faulty_cell}); see docs/can-pack.md, and "
                f"that it has {self._settings.cells} cells"
            )

    def _check_identity(self, heard: Any) -> None:
        settings = self._settings
        if heard.network_version != lib.PACK_NETWORK_VERSION:
            raise BusError(
                f"the pack's ECU speaks version {heard.network_version} of the CAN database, "
                f"this bms has version {lib.PACK_NETWORK_VERSION}; update the older one"
            )
        has = (heard.cells, f"{heard.preset_hash:04x}", f"{heard.model_hash:08x}")
        if has != (settings.cells, settings.preset.hash[:4], settings.model.hash[:8]):
            raise ModelMismatchError(
                f"the pack's ECU has {has[0]} cells, preset {has[1]}... and model {has[2]}..., the "
                f"plant {settings.cells} cells, '{settings.preset.name}' with "
                f"{settings.preset.hash[:4]}... and {settings.model.hash[:8]}...; give both the "
                "same --cells, --preset and --model"
            )

    def _has_balanced(self) -> bool:
        """Whether the pack has been full for as long as it is to stay plugged in."""
        result = self._result
        if result.full is None:
            result.full = result.steps
            result.full_socs = self._plant.socs()
        period_s = self._settings.preset.timing.sampling_period_s
        return (result.steps - result.full) * period_s >= self._settings.balance_s

    def _stop_reason(self, heard: Any) -> str:
        result = self._result
        if result.edge is None or result.steps <= result.edge:
            return ""
        if self._ends_early:
            if self._silent_periods >= SILENT_PERIODS:
                return STOP_SILENT
            if heard.state == CommandState.COMPLETE and self._has_balanced():
                return STOP_COMPLETE
            if heard.state == CommandState.FAULT:
                return STOP_FAULT
        run_s = (result.steps - result.edge) * self._settings.preset.timing.sampling_period_s
        return STOP_TIME_LIMIT if run_s >= self._settings.max_time_s else ""
