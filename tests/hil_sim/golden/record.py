"""Records the golden logs with the present firmware.

    python -m tests.hil_sim.golden.record [NAME...]

Nothing runs this by itself. After a change of behaviour that is wanted, look at what
`bms replay` says about the old logs first, then record anew and commit the logs with the change.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bms.firmware import Ecu
from bms.model.model_file import shipped_model_path
from bms.presets import load_preset
from hil_sim.bus.buses import open_bus
from hil_sim.bus.catalog import Mode
from hil_sim.bus.database import load_codecs
from hil_sim.faults import Injection, parse_fault
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.ecu import EcuNode
from hil_sim.nodes.plant import PlantNode, Request
from hil_sim.nodes.turns import LockStep
from hil_sim.plant.charger import Charger
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source
from hil_sim.plant.plant import SUB_STEPS, Plant
from hil_sim.plant.sensors import Readings, SensorSuite

FOLDER = Path(__file__).parent
SEED = 5


@dataclass(frozen=True)
class Scenario:
    """A run of some periods; the request is on in the given ranges of them."""

    periods: int
    on: tuple[range, ...] = (range(6, 10_000),)
    preset: str = "paper_calibrated"
    lagged: bool = False
    mode: Mode | None = None
    soc: float | None = None
    temperature_K: float | None = None
    disturbance: DisturbanceKind = DisturbanceKind.GAUSSIAN
    faults: tuple[Mapping[str, Any], ...] = field(default=())


SCENARIOS = {
    "charge_start": Scenario(250),
    "lin2014_hot": Scenario(250, preset="lin2014", mode=Mode.FIXED, temperature_K=321.0, soc=0.3),
    "cold_start": Scenario(250, temperature_K=278.5, soc=0.05),
    "hot_derating": Scenario(
        350,
        temperature_K=321.0,
        soc=0.2,
        disturbance=DisturbanceKind.UPWARD,
    ),
    "lagged_model": Scenario(
        350,
        on=(range(160, 10_000),),
        lagged=True,
        mode=Mode.FIXED,
        temperature_K=318.0,
        soc=0.3,
        faults=(
            {"kind": "sensor-not-available", "sensor": "current_A", "from_period": 210}
            | {"for_periods": 1},
            {
                "kind": "message-lost",
                "message": "CellThermal",
                "from_period": 300,
                "for_periods": 1,
            },
        ),
    ),
    "message_loss": Scenario(
        320,
        on=(range(6, 200), range(240, 10_000)),
        soc=0.3,
        faults=(
            {"kind": "message-lost", "message": "CellThermal", "from_period": 40, "for_periods": 1},
            {"kind": "message-lost", "message": "Coolant", "from_period": 70, "for_periods": 2},
            {"kind": "message-repeated", "message": "ChargeRequest", "from_period": 100}
            | {"for_periods": 1},
            {"kind": "message-lost", "message": "CellElectrical", "from_period": 140}
            | {"for_periods": 30},
        ),
    ),
    "corrupted_frames": Scenario(
        300,
        on=(range(6, 200), range(240, 10_000)),
        soc=0.3,
        faults=(
            {"kind": "byte-corrupted", "message": "CellElectrical", "byte": 3, "from_period": 50}
            | {"for_periods": 1},
            {"kind": "message-wrong-length", "message": "Coolant", "length": 3, "from_period": 80}
            | {"for_periods": 1},
            {"kind": "message-masqueraded", "message": "CellThermal", "from_period": 130}
            | {"for_periods": 40},
        ),
    ),
    "sensor_fault": Scenario(
        300,
        on=(range(6, 180), range(220, 10_000)),
        soc=0.3,
        temperature_K=305.0,
        faults=(
            {"kind": "sensor-not-available", "sensor": "coolant_temperature_K", "from_period": 50}
            | {"for_periods": 1},
            {"kind": "sensor-biased", "sensor": "coolant_temperature_K", "offset": -25.0}
            | {"from_period": 80, "for_periods": 1},
            {"kind": "sensor-biased", "sensor": "surface_temperature_K", "offset": -9.0}
            | {"from_period": 120, "for_periods": 60},
        ),
    ),
    "request_off_on": Scenario(
        300,
        on=(range(30), range(50, 90), range(91, 150), range(200, 260)),
        soc=0.5,
        temperature_K=300.0,
    ),
    "infeasible": Scenario(250, temperature_K=322.95, soc=0.5, disturbance=DisturbanceKind.UPWARD),
    "complete": Scenario(350, temperature_K=305.0, soc=0.984),
}


def record(name: str, path: Path) -> None:
    """Play a scenario of that name and write its log."""
    scenario = SCENARIOS[name]
    shipped = load_preset(scenario.preset)
    preset = replace(
        shipped,
        initial=replace(
            shipped.initial,
            soc=scenario.soc or shipped.initial.soc,
            temperature_K=scenario.temperature_K or shipped.initial.temperature_K,
        ),
    )
    model = shipped_model_path(shipped.name, lagged=True) if scenario.lagged else None
    database, period_s = load_codecs(), preset.timing.sampling_period_s
    seeds = np.random.SeedSequence(SEED).spawn(3)
    rng = np.random.default_rng(seeds[0])
    plant = Plant(
        preset, disturbance_source(scenario.disturbance, preset, period_s / SUB_STEPS, rng)
    )
    sensors = SensorSuite(preset.sensors, np.random.default_rng(seeds[1]))
    faults = [parse_fault(fault, name) for fault in scenario.faults]
    injection = Injection(faults, period_s, seeds[2], database)
    charger = Charger(preset)
    plug_in_soc = preset.initial.soc
    with open_bus(f"virtual:{name}") as ecu_bus, open_bus(f"virtual:{name}") as plant_bus:
        ecu = EcuNode(ecu_bus, Ecu(shipped, model))
        turn = LockStep(period_s, 0.0, lambda: ecu.answer(0.0))
        with Recorder(path) as recorder:
            node = PlantNode(plant_bus, database, turn, recorder, injection.sent, injection.heard)
            for period in range(scenario.periods):
                injection.begin(period, plant)
                is_on = any(period in periods for periods in scenario.on)
                if not is_on:
                    plug_in_soc = plant.state.soc
                answer = node.exchange(
                    period,
                    injection.readings(sensors.read(_readings(plant)), plant.state),
                    Request(is_on, preset.limits.reference_current_A, plug_in_soc, scenario.mode),
                )
                plant.current_A = injection.supplied_A(
                    charger.current_A(answer.usable_command_A), plant.current_A
                )
                plant.advance()


def _readings(plant: Plant) -> Readings:
    return Readings(
        plant.current_A,
        plant.voltage_V,
        plant.state.surface_temperature_K,
        plant.state.coolant_temperature_K,
        plant.cooling_power_W,
    )


def main() -> None:
    """Record the named scenarios, or all."""
    for name in sys.argv[1:] or SCENARIOS:
        path = FOLDER / f"{name}.log.gz"
        record(name, path)
        print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
