"""The parts of a run, made from its settings; each has randomness of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bms.baselines import BASELINES
from bms.errors import InputError
from bms.firmware import Ecu
from hil_sim.bus.database import MessageCodec
from hil_sim.faults import Injection
from hil_sim.nodes.ecu import EcuLike
from hil_sim.nodes.python_ecu import PythonEcu
from hil_sim.nodes.views import BusMeasurements, TrueState
from hil_sim.plant.catalog import make_plant
from hil_sim.plant.charger import Charger
from hil_sim.plant.disturbances import disturbance_source
from hil_sim.plant.plant import SUB_STEPS, Plant
from hil_sim.plant.seam import PlantLike
from hil_sim.plant.sensors import SensorSuite
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.settings import ControllerKind, Settings

EcuFactory = Callable[[PlantLike, "dict[str, MessageCodec]"], EcuLike]


def _seeds(seed: int) -> list[np.random.SeedSequence]:
    """Independent randomness for disturbance, sensors and faults, so that one leaves the others."""
    return np.random.SeedSequence(seed).spawn(3)


def injection_of(settings: Settings, database: dict[str, MessageCodec]) -> Injection:
    """The faults; InputError for one that acts on the wall clock in a run in virtual time."""
    for fault in settings.faults:
        if fault.needs_realtime and not settings.realtime:
            raise InputError(f"fault '{fault.kind}': acts on the wall clock; add --realtime")
    period_s = settings.preset.timing.sampling_period_s
    return Injection(settings.faults, period_s, _seeds(settings.seed)[2], database)


def plant_of(settings: Settings) -> PlantLike:
    """The plant of the settings at its start, with its disturbance; InputError without it."""
    preset = settings.preset
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    rng = np.random.default_rng(_seeds(settings.seed)[0])
    disturbance = disturbance_source(settings.disturbance, preset, step_s, rng)
    if settings.true_cell is not None:
        return Plant(preset, disturbance, settings.true_cell)
    started = replace(preset, initial=settings.initial or preset.initial)
    return make_plant(settings.plant, started, disturbance)


def sensors_of(settings: Settings) -> SensorSuite:
    """The sensors, with their noise and the biases that are true of them."""
    sensors, true_cell = settings.preset.sensors, settings.true_cell
    if true_cell is not None:
        sensors = true_cell.sensors(sensors)
    return SensorSuite(sensors, np.random.default_rng(_seeds(settings.seed)[1]))


def charger_of(settings: Settings) -> Charger:
    """The charger: ideal, but for what is true of it. Raises InputError as Charger does."""
    supply = settings.true_cell or nominal_cell(settings.preset)
    return Charger(
        settings.preset,
        settings.charger_delay_periods,
        supply.supply_tolerance,
        supply.supply_lag_s,
    )


def ecu_factory_of(settings: Settings) -> EcuFactory:
    """How to make the controller: the firmware, or a baseline with what its method sees."""
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
