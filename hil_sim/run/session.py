"""Ways to run: plant and ECU in one thread, on clocks of their own, or the plant alone."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from threading import Event, Thread

from bms.errors import InputError
from bms.image import calibration_content, shipped_contents
from bms.model.model_file import KanModel
from hil_sim.bus.buses import CanBus, is_serial_line, open_bus, require_room_for_ecu, require_shared
from hil_sim.bus.database import MessageCodec, load_codecs
from hil_sim.faults import Injection
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.clock import WallClock
from hil_sim.nodes.ecu import EcuNode
from hil_sim.nodes.line_losses import LossWatch
from hil_sim.nodes.plant import PlantNode
from hil_sim.nodes.turns import LockStep, OnClock, PacedLockStep, Turn
from hil_sim.plant.seam import PlantLike
from hil_sim.run.charge import Charge, Progress
from hil_sim.run.parts import (
    EcuFactory,
    charger_of,
    ecu_factory_of,
    injection_of,
    plant_of,
    sensors_of,
)
from hil_sim.run.result import RunResult
from hil_sim.run.settings import ControllerKind, Settings
from hil_sim.run.summary import sum_up

LINE_ANSWER_TIMEOUT_S = 3.0
"""An emulated board has to start first, and shares the machine with others."""


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
    injection = injection_of(settings, database)
    with ExitStack() as stack:
        plant = plant_of(settings)
        make = ecu_factory or ecu_factory_of(settings)
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
    injection = injection_of(settings, database)
    plant = plant_of(settings)
    ecu = injection.ecu(lambda: ecu_factory_of(settings)(plant, database))
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
    plant = plant_of(settings)
    with open_bus(settings.bus) as bus:
        turn: Turn
        if settings.realtime:
            turn = OnClock(period_s, WallClock())
        else:
            turn = LockStep(period_s, settings.answer_timeout_s)
        injection = injection_of(settings, database)
        return _run(settings, plant, bus, database, turn, injection, recorder, progress)


def _run(
    settings: Settings,
    plant: PlantLike,
    bus: CanBus,
    database: dict[str, MessageCodec],
    turn: Turn,
    injection: Injection,
    recorder: Recorder | None,
    progress: Progress,
) -> RunResult:
    preset, model = settings.preset, settings.model
    is_firmware = settings.controller is ControllerKind.KAN_RCBF
    own = model if is_firmware and isinstance(model, KanModel) else None
    if own is None and is_firmware:
        shipped_contents()  # before the first period, which must not wait
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
        sensors=sensors_of(settings),
        charger=charger_of(settings),
        injection=injection,
        max_time_s=settings.max_time_s,
        ends_early=settings.ends_early,
        model_hash=own.hash if own else None,
        content=calibration_content(preset, own) if own else None,
        plug_in_soc=settings.true_cell.plug_in_soc if settings.true_cell else None,
        progress=progress,
        mode=settings.mode if is_firmware else None,
        full_by_s=settings.full_by_s,
    )
    start_s = time.perf_counter()
    reason = charge.run()
    wall_time_s = time.perf_counter() - start_s
    if is_serial_line(settings.bus):
        losses.hear_out(bus)
    return sum_up(settings, charge, reason, wall_time_s, turn.watch, losses.losses)
