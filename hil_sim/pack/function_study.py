"""State of function beside foxBMS's trapezoid: `python -m hil_sim.pack.function_study [PACKS]`.

While packs charge under their ECU, every few seconds the currents that the ECU and the trapezoids
allow are held against the strongest one that the true plant bears for 10 s.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.catalog import CommandState
from hil_sim.pack.admitted import Ahead
from hil_sim.pack.charge import OFF_PERIODS
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.trapezoid import Readings, Trapezoid
from hil_sim.studies.pack.function import SOON_S

EVERY_PERIODS = 50
START_SOCS = (0.01, 0.9)
"""State of charge at plug-in, in the mean: an empty pack, and one of which the top is filled."""
OURS, FOXBMS_2, FOXBMS_1 = "this ECU", "foxBMS 2", "foxBMS 2 and state of charge as foxBMS 1"
SLACK_A = 0.01
"""Resolution of what the plant is found to bear."""


@dataclass(frozen=True)
class Sample:
    """An instant of a charge; currents are 0 A or negative."""

    time_s: float
    borne_A: float
    """What the plant bears for SOON_S."""
    now_A: float
    promised_A: dict[str, float]
    over: dict[str, Array]
    """By how much each promise, held for SOON_S, exceeds limits; see Ahead.over."""


def samples(settings: PackChargeSettings, every: int = EVERY_PERIODS) -> Iterator[Sample]:
    """Of one charge from the request until it is over."""
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire, ahead = PackWire(settings, plant), Ahead(settings, plant, SOON_S)
    fox = {
        FOXBMS_2: Trapezoid(settings.preset),
        FOXBMS_1: Trapezoid(settings.preset, by_soc=True),
    }
    period_s = settings.preset.timing.sampling_period_s
    for period in range(round(settings.max_time_s / period_s)):
        plant.measure()
        heard = wire.hear(ecu.exchange(wire.publish(charge=period > OFF_PERIODS)))
        if heard.state in (CommandState.COMPLETE, CommandState.FAULT):
            return
        if ecu.state.pack.soc_known and (period - OFF_PERIODS - 1) % every == 0:
            readings = _readings(settings, plant, heard)
            promised = {OURS: float(heard.allowed_soon_A)}
            promised |= {name: one.allowed_A(readings) for name, one in fox.items()}
            over = {name: ahead.over(current_A) for name, current_A in promised.items()}
            yield Sample(
                period * period_s, ahead.strongest_A(), float(heard.allowed_now_A), promised, over
            )
        plant.hold(obeyed_A(heard))


def _readings(settings: PackChargeSettings, plant: PackPlant, heard: Any) -> Readings:
    voltages = list(plant.measured.voltage_V)[: settings.cells]
    surfaces = list(plant.measured.surface_temperature_K)[: len(settings.view.thermistors)]
    return Readings(max(voltages), max(surfaces), min(surfaces), float(heard.highest_soc))


def figures(found: list[Sample]) -> dict[str, Any]:
    """How often and by how much each promises more or less than the plant bears."""
    borne = -np.array([one.borne_A for one in found])
    said: dict[str, Any] = {"samples": len(found)}
    for name in found[0].promised_A:
        promised = -np.array([one.promised_A[name] for one in found])
        over = np.array([one.over[name] for one in found])
        more, less = promised - borne, borne - promised
        said[name] = {
            "over_promised": int((more > SLACK_A).sum()),
            "most_over_A": float(more.max()),
            "mean_under_A": float(np.maximum(less, 0.0).mean()),
            "most_under_A": float(less.max()),
            "share_of_borne": float(promised.sum() / borne.sum()),
            "worst_over": dict(zip(("soc", "core_K", "surface_K", "voltage_V"), over.max(axis=0))),
        }
    return said


def study(packs: int, cells: int = 16, every: int = EVERY_PERIODS) -> dict[str, Any]:
    """Figures over the charges of packs of so many cells, by seed from 0 on, for each start."""
    preset, model = load_pair(DEFAULT_PRESET, None)
    said: dict[str, Any] = {"packs": packs, "cells": cells}
    for soc in START_SOCS:
        start = replace(preset, initial=replace(preset.initial, soc=soc))
        found = [
            sample
            for seed in range(packs)
            for sample in samples(PackChargeSettings(start, model, cells, seed=seed), every)
        ]
        said[f"from {soc:g}"] = figures(found)
    return said


if __name__ == "__main__":
    print(json.dumps(study(int(sys.argv[1]) if len(sys.argv) > 1 else 20), indent=2))
