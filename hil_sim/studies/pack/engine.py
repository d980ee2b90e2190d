"""Charges of a pack in C: one object for one charge, stepped in blocks of control periods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.calibration import calibration_fields
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Sensor
from hil_sim.native.cell_fields import cell_fields
from hil_sim.plant.true_cell import COOLING_BAND_K
from hil_sim.run.charge import OFF_PERIODS
from hil_sim.studies.campaign.real_summary import OVERFILLED_SOC
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.reserves import Reserves
from hil_sim.studies.pack.spread import PackDraw, Surroundings, memory_fields

SUB_STEPS: int = lib.PACK_SUB_STEPS
MAX_CELLS: int = lib.BMS_MAX_CELLS
NO_THERMISTOR: int = lib.PACK_NO_THERMISTOR
NO_CELL: int = lib.PACK_NO_CELL
OUTCOMES = ("running", "complete", "fault", "time-limit")
BLOCK_PERIODS = 500


@dataclass(frozen=True)
class View:
    """What a controller sees of a pack: which cells, and which of these have a thermistor.

    `thermistors` are positions in `cells`. A view of the mean takes all cells for one.
    """

    cells: tuple[int, ...]
    thermistors: tuple[int, ...]
    is_mean: bool = False

    @property
    def thermistor_of(self) -> list[int]:
        """Number of each cell's thermistor among `thermistors`; NO_THERMISTOR for none."""
        numbers = {cell: number for number, cell in enumerate(self.thermistors)}
        return [numbers.get(i, NO_THERMISTOR) for i in range(len(self.cells))]


def all_cells(cells: int, per_thermistor: int = 1) -> View:
    """All cells, with a thermistor at the middle one of each group of so many."""
    every = tuple(range(cells))
    middle = per_thermistor // 2
    groups = range(0, cells, per_thermistor)
    return View(every, tuple(min(first + middle, cells - 1) for first in groups))


def peak_limits(preset: Preset) -> Array:
    """Limits of what PackCharge.peaks gives of each cell.

    A family's cell is full by its voltage; it is overfilled where a campaign says so too.
    """
    limits = preset.limits
    return np.array(
        [
            limits.max_soc if preset.cell.interval is None else OVERFILLED_SOC,
            limits.max_core_temperature_K,
            limits.max_surface_temperature_K,
            limits.max_voltage_V,
        ]
    )


def one_cell(index: int) -> View:
    """One cell alone, with a thermistor."""
    return View((index,), (0,))


def mean_of_all(cells: int) -> View:
    """The mean voltage and surface temperature of all cells."""
    return View(tuple(range(cells)), tuple(range(cells)), is_mean=True)


@dataclass(frozen=True)
class Core:
    """Constants of a pack's control core."""

    preset: Preset
    model: KanModel
    reserves: Reserves
    calibration: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises InputError or ModelMismatchError as bms.calibration.calibration_fields does."""
        fields = calibration_fields(self.preset, self.model, self.reserves.changes)
        fields["plausibility"]["surface_deficit_K"] += self.reserves.deficit_K
        object.__setattr__(self, "calibration", ffi.new("bms_calibration_t *", fields))


class PackCharge:
    """One pack on one controller; `fields` is the C structure with everything that is known."""

    def __init__(
        self, core: Core, pack: PackDraw, around: Surroundings, view: View, max_time_s: float
    ) -> None:
        preset = core.preset
        step_s = preset.timing.sampling_period_s / SUB_STEPS
        self._core = core  # C points to its calibration
        self._count = len(pack.cells)
        self._cells = ffi.new(
            "plant_cell_t[]",
            [
                {
                    "cell": cell_fields(cell, step_s),
                    "memory": memory_fields(cell, state),
                    "rate": tuple(rate),
                }
                for cell, state, rate in zip(pack.cells, pack.states, pack.disturbances)
            ],
        )
        thermistor_of = [0] if view.is_mean else view.thermistor_of
        socs = [pack.states[i].soc for i in view.cells]
        self._seen = ffi.new("uint8_t[]", list(view.cells))
        self._owners = ffi.new("uint8_t[]", [view.cells[i] for i in view.thermistors])
        self._socs = ffi.new("float[]", [float(np.mean(socs))] if view.is_mean else socs)
        self.fields: Any = ffi.new(
            "pack_charge_t *",
            {
                "plant": {
                    "cells": self._count,
                    "cell": self._cells,
                    "neighbour_W_per_K": around.neighbour_W_per_K,
                    "flow_W_per_K": around.flow_W_per_K,
                },
                "period_s": preset.timing.sampling_period_s,
                "max_time_s": max_time_s,
                "reference_current_A": preset.limits.reference_current_A,
                "full_cooling_W": preset.initial.cooling_power_W,
                "coolant_floor_K": 0.0,
                "cooling_band_K": COOLING_BAND_K,
                "noise_cutoff": Sensor.NOISE_CUTOFF,
                "off_periods": OFF_PERIODS,
                "current": _sensor(preset.sensors.current_A),
                "voltage": _sensor(preset.sensors.voltage_V),
                "surface": _sensor(preset.sensors.surface_temperature_K),
                "coolant": _sensor(preset.sensors.coolant_temperature_K),
                "power": _sensor(preset.sensors.cooling_power_W),
                "seen": len(view.cells),
                "seen_cell": self._seen,
                "thermistor_cell": self._owners,
                "sees_mean": view.is_mean,
                "plug_in_soc": self._socs,
            },
        )
        kept_map = ffi.new("uint8_t[]", thermistor_of)  # until pack_init has read it
        config = ffi.new(
            "pack_config_t *",
            {
                "calibration": core.calibration,
                "cells": len(thermistor_of),
                "thermistors": 1 if view.is_mean else len(view.thermistors),
                "thermistor_of": kept_map,
                "bare": core.reserves.bare,
            },
        )
        lib.pack_charge_begin(self.fields, config)

    @property
    def is_over(self) -> bool:
        """Whether the charge has come to an end."""
        return bool(self.fields.outcome != lib.PACK_RUNNING)

    @property
    def outcome(self) -> str:
        """How it ended, one of OUTCOMES."""
        return OUTCOMES[self.fields.outcome]

    def peaks(self) -> Array:
        """Greatest state of charge, core and surface temperature and voltage of each cell."""
        peaks = [self._cells[i].peaks for i in range(self._count)]
        return np.array(
            [(p.soc, p.core_temperature_K, p.surface_temperature_K, p.voltage_V) for p in peaks]
        )

    def advance(self, normals: Array) -> None:
        """Run n periods or to the end, with standard normal numbers (n, 2 cells + 4)."""
        width = 2 * self._count + lib.PACK_SHARED_NORMALS
        if normals.shape[1:] != (width,):
            raise ValueError(f"normals must have shape (n, {width})")
        numbers = ffi.from_buffer("double[]", np.ascontiguousarray(normals))
        lib.pack_charge_advance(self.fields, numbers, len(normals))


def play(charges: Sequence[PackCharge], cells: int, rng: np.random.Generator) -> None:
    """Charges of one pack to their ends, with the same sensor noise."""
    width = 2 * cells + lib.PACK_SHARED_NORMALS
    while not all(charge.is_over for charge in charges):
        normals = rng.standard_normal((BLOCK_PERIODS, width))
        for charge in charges:
            charge.advance(normals)


def _sensor(sensor: Sensor) -> dict[str, float]:
    return {"resolution": sensor.resolution, "noise_std": sensor.noise_std}
