"""Puts the parts of a run together: seeds, buses, nodes, controller; runs; sums up."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from threading import Event, Thread

import numpy as np

from bms.baselines import BASELINES
from bms.errors import InputError
from bms.firmware import Ecu
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Initial
from hil_sim.bus.buses import CanBus, is_serial_line, open_bus, require_room_for_ecu, require_shared
from hil_sim.bus.database import MessageCodec, load_codecs
from hil_sim.faults import Fault, Injection
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.clock import WallClock
from hil_sim.nodes.ecu import EcuLike, EcuNode
from hil_sim.nodes.line_losses import LineLosses, LossWatch
from hil_sim.nodes.plant import PlantNode
from hil_sim.nodes.punctuality import PlantWatch
from hil_sim.nodes.python_ecu import PythonEcu
from hil_sim.nodes.turns import LockStep, OnClock, PacedLockStep, Turn
from hil_sim.nodes.views import BusMeasurements, TrueState
from hil_sim.plant.charger import Charger
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source
from hil_sim.plant.plant import SUB_STEPS, Plant
from hil_sim.plant.sensors import SensorSuite
from hil_sim.run.charge import Charge, Progress
from hil_sim.run.result import (
    STOP_COMPLETE,
    RunResult,
    Summary,
    estimate_errors_K,
    first_derate_s,
    infeasible_steps,
    rmse_K,
)

ANSWER_TIMEOUT_S = 1.0
LINE_ANSWER_TIMEOUT_S = 3.0
"""An emulated board has to start first, and shares the machine with others."""


class ControllerKind(str, Enum):
    """Names on the command line: the firmware, and each of bms.baselines.BASELINES."""

    KAN_RCBF = "kan-rcbf"
    S_CBF = "s-cbf"
    S_CBF_SINGLE_STEP = "s-cbf-single-step"
    CC_CV = "cc-cv"
    MULTI_STAGE = "multi-stage"


EcuFactory = Callable[[Plant, "dict[str, MessageCodec]"], EcuLike]


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
    ends_early: bool = True
    initial: Initial | None = None
    """State of the cell at the start; that of the preset without."""


def run_both(
    settings: Settings,
    recorder: Recorder | None = None,
    progress: Progress = lambda soc: None,
    ecu_factory: EcuFactory | None = None,
) -> RunResult:
    """Plant and ECU in this process and thread, on two connections to one bus.

    `ecu_factory` replaces the controller that the settings name. Raises InputError or BusError.
    """
    require_room_for_ecu(settings.bus)
    database = load_codecs()
    injection = _injection(settings, database)
    with ExitStack() as stack:
        plant = _plant(settings)
        make = ecu_factory or _factory(settings)
        ecu = injection.ecu(lambda: make(plant, database))
        ecu_bus = stack.enter_context(open_bus(settings.bus))
        plant_bus = stack.enter_context(open_bus(settings.bus))
        node = EcuNode(ecu_bus, ecu)
        period_s = settings.preset.timing.sampling_period_s
        timeout_s = settings.answer_timeout_s

        def serve() -> None:
            node.answer(timeout_s)

        turn: Turn
        if settings.realtime:
            turn = PacedLockStep(period_s, timeout_s, serve, WallClock())
        else:
            turn = LockStep(period_s, timeout_s, serve)
        return _run(settings, plant, plant_bus, database, turn, injection, recorder, progress)


def run_sil(
    settings: Settings, recorder: Recorder | None = None, progress: Progress = lambda soc: None
) -> RunResult:
    """The plant with the ECU that belongs to the bus: at the other end of a line, else here.

    Raises InputError, ModelMismatchError or BusError.
    """
    if not is_serial_line(settings.bus):
        return run_both(settings, recorder, progress)
    patient = replace(settings, answer_timeout_s=LINE_ANSWER_TIMEOUT_S)
    return run_plant(patient, recorder, progress)


def run_on_clocks(
    settings: Settings, recorder: Recorder | None = None, progress: Progress = lambda soc: None
) -> RunResult:
    """Plant and firmware in this process, each in a thread and on a clock of its own, without SYNC.

    Raises InputError or BusError.
    """
    require_room_for_ecu(settings.bus)
    database = load_codecs()
    injection = _injection(settings, database)
    plant = _plant(settings)
    ecu = injection.ecu(lambda: _factory(settings)(plant, database))
    period_s = settings.preset.timing.sampling_period_s
    with (
        open_bus(settings.bus) as ecu_bus,
        open_bus(settings.bus) as plant_bus,
        _running_on_clock(EcuNode(ecu_bus, ecu), period_s),
    ):
        turn = OnClock(period_s, WallClock())
        return _run(settings, plant, plant_bus, database, turn, injection, recorder, progress)


@contextmanager
def _running_on_clock(node: EcuNode, period_s: float) -> Iterator[None]:
    stop = Event()
    arguments = (period_s, WallClock(), float("inf"), stop.is_set)
    thread = Thread(target=node.run_on_clock, args=arguments, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def run_plant(
    settings: Settings, recorder: Recorder | None = None, progress: Progress = lambda soc: None
) -> RunResult:
    """The plant alone, with an ECU on the bus in another process.

    Raises InputError for a bus that no other process can be on and for faults inside the ECU,
    BusError when no ECU answers.
    """
    require_shared(settings.bus)
    for fault in settings.faults:
        if fault.needs_own_ecu:
            raise InputError(
                f"fault '{fault.kind}': happens inside the ECU, which is not in this process; "
                "use 'bms sil' on another bus, or restart the ECU itself"
            )
    database = load_codecs()
    period_s = settings.preset.timing.sampling_period_s
    plant = _plant(settings)
    with open_bus(settings.bus) as bus:
        turn: Turn
        if settings.realtime:
            turn = OnClock(period_s, WallClock())
        else:
            turn = LockStep(period_s, settings.answer_timeout_s)
        injection = _injection(settings, database)
        return _run(settings, plant, bus, database, turn, injection, recorder, progress)


def _seeds(seed: int) -> list[np.random.SeedSequence]:
    """Independent randomness for disturbance, sensors and faults, so that one leaves the others."""
    return np.random.SeedSequence(seed).spawn(3)


def _injection(settings: Settings, database: dict[str, MessageCodec]) -> Injection:
    for fault in settings.faults:
        if fault.needs_realtime and not settings.realtime:
            raise InputError(f"fault '{fault.kind}': acts on the wall clock; add --realtime")
    period_s = settings.preset.timing.sampling_period_s
    return Injection(settings.faults, period_s, _seeds(settings.seed)[2], database)


def _plant(settings: Settings) -> Plant:
    preset = settings.preset
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    rng = np.random.default_rng(_seeds(settings.seed)[0])
    disturbance = disturbance_source(settings.disturbance, preset, step_s, rng)
    return Plant(replace(preset, initial=settings.initial or preset.initial), disturbance)


def _factory(settings: Settings) -> EcuFactory:
    preset = settings.preset
    if settings.controller is ControllerKind.KAN_RCBF:
        return lambda plant, database: Ecu(preset=preset, model=settings.model)
    baseline = BASELINES[settings.controller.value]
    return lambda plant, database: PythonEcu(
        lambda: baseline.make(preset),
        preset,
        database,
        TrueState(plant) if baseline.knows_true_state else BusMeasurements(preset, database),
    )


def _run(
    settings: Settings,
    plant: Plant,
    bus: CanBus,
    database: dict[str, MessageCodec],
    turn: Turn,
    injection: Injection,
    recorder: Recorder | None,
    progress: Progress,
) -> RunResult:
    preset, model = settings.preset, settings.model
    is_firmware = settings.controller is ControllerKind.KAN_RCBF
    losses = LossWatch()
    charge = Charge(
        preset=preset,
        node=PlantNode(
            bus,
            database,
            turn,
            recorder,
            injection.sent,
            lambda frames: injection.heard(losses.pass_on(frames)),
        ),
        plant=plant,
        sensors=SensorSuite(preset.sensors, np.random.default_rng(_seeds(settings.seed)[1])),
        charger=Charger(preset, settings.charger_delay_periods),
        injection=injection,
        max_time_s=settings.max_time_s,
        ends_early=settings.ends_early,
        model_hash=model.hash if is_firmware and isinstance(model, KanModel) else None,
        progress=progress,
    )
    start_s = time.perf_counter()
    reason = charge.run()
    wall_time_s = time.perf_counter() - start_s
    if is_serial_line(settings.bus):
        losses.hear_out(bus)
    return _sum_up(settings, charge, reason, wall_time_s, turn.watch, losses.losses)


def _sum_up(
    settings: Settings,
    charge: Charge,
    reason: str,
    wall_time_s: float,
    watch: PlantWatch | None,
    losses: LineLosses,
) -> RunResult:
    series, extremes = charge.series, charge.plant.extremes
    limits = settings.preset.limits
    estimates = settings.controller is ControllerKind.KAN_RCBF
    errors_K = estimate_errors_K(series) if estimates else []
    violations = tuple(extremes.violations(limits))
    summary = Summary(
        controller=settings.controller.value,
        preset=settings.preset.name,
        bus=settings.bus,
        steps=charge.steps,
        max_core_temperature_K=extremes.core_temperature_K,
        max_surface_temperature_K=extremes.surface_temperature_K,
        max_voltage_V=extremes.voltage_V,
        final_soc=charge.plant.state.soc,
        charge_time_s=series.time_s[-1] if reason == STOP_COMPLETE else None,
        first_derate_s=first_derate_s(series),
        kan_rmse_K=rmse_K(errors_K),
        kan_max_abs_error_K=max(map(abs, errors_K), default=None),
        wall_time_s=round(wall_time_s, 3),
        max_soc=extremes.soc,
        limits_kept=not violations,
        violations=violations,
        stop_reason=reason,
        first_fault=charge.first_fault,
        infeasible_steps=infeasible_steps(series),
        error_bound_K=charge.error_bound_K if estimates else None,
        seed=settings.seed,
        disturbance=settings.disturbance.value,
        realtime=settings.realtime,
        model_hash=charge.identity.model_hash if charge.identity else None,
        preset_hash=settings.preset.hash,
        command_reception=charge.node.command_counts,
        faults=charge.injection.injected,
        timing=watch.timing([command is not None for command in series.command_A])
        if watch is not None
        else None,
        line_losses=losses if is_serial_line(settings.bus) else None,
    )
    return RunResult(summary, series, watch)
