"""The plant of a pack: cells, sensors and charger, and their end of the bus."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hil_sim.bus.frame import Frame
from hil_sim.pack.foreign_cells import ForeignCells
from hil_sim.pack.frames import FRAME, packed, unpacked
from hil_sim.pack.settings import PackChargeSettings, spread_of
from hil_sim.plant.charger import Charger
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import BLOCK_PERIODS, SUB_STEPS, PackCharge
from hil_sim.studies.pack.spread import draw_pack

Tamper = Callable[["PackPlant"], None]
"""Changes what the sensors of a plant have read, in place."""
_UNSAID = 255


class PackPlant:
    """Draws the cells and the noise as `bms pack` does for its pack 0 of the same seed."""

    def __init__(self, settings: PackChargeSettings) -> None:
        """Raises InputError as ForeignCells, whose cells are the settings' `cell_plants`."""
        preset = settings.preset
        children = np.random.SeedSequence(entropy=settings.seed, spawn_key=(0,)).spawn(4)
        draws, self._noise, _, string = (
            np.random.Generator(np.random.Philox(child)) for child in children
        )
        drawn = draw_pack(
            preset, spread_of(settings.spread), settings.cells, draws, settings.disturbed
        )
        self._settings = settings
        self._charge = PackCharge(
            settings.core(), drawn, settings.around, settings.view, settings.max_time_s
        )
        self._string_noise = string
        self.fields: Any = self._charge.fields
        """The C structure with cells, sensors and current."""
        self.fields.plant.bleed_ohm = settings.bleed_ohm
        self._foreign = ForeignCells(preset, drawn, settings.cell_plants, self.fields)
        self.charger = Charger(preset)
        self.measured: Any = ffi.new("pack_measured_t *")
        """What the sensors read last."""
        self.pack_voltage_V = 0.0
        sensor = settings.pack_voltage_sensor
        self._string_sensor = ffi.new(
            "pack_sensor_t *", {"resolution": sensor.resolution, "noise_std": sensor.noise_std}
        )
        self._block: Any = None
        self._row = BLOCK_PERIODS
        self._width = 2 * settings.cells + lib.PACK_SHARED_NORMALS
        self._string_cutoff = sensor.NOISE_CUTOFF

    def measure(self) -> None:
        """Read all sensors for a control period."""
        if self._row == BLOCK_PERIODS:
            self._block = self._noise.standard_normal((BLOCK_PERIODS, self._width))
            self._row = 0
        normals = ffi.from_buffer("double[]", self._block[self._row])
        self._row += 1
        lib.pack_charge_measure(self.fields, normals, self.measured)
        for cell in self._foreign.plants:
            self.measured.voltage_V[cell] = lib.pack_sensor_reading(
                ffi.addressof(self.fields, "voltage"),
                self.voltage_V(cell),
                normals[2 * cell],
                self.fields.noise_cutoff,
            )
        truth_V = sum(map(self.voltage_V, range(self._settings.cells)))
        self.pack_voltage_V = lib.pack_sensor_reading(
            self._string_sensor, truth_V, self._string_noise.standard_normal(), self._string_cutoff
        )

    def hold(self, command_A: float | None) -> None:
        """Supply what may be supplied for a command, None without one, for a control period."""
        self.fields.current_A = self.charger.current_A(command_A)
        if self._foreign.plants:
            self._foreign.hold(self.fields.current_A)
        else:
            lib.plant_hold(ffi.addressof(self.fields, "plant"), self.fields.current_A, SUB_STEPS)

    def bleed(self, heard: Any) -> None:
        """Switch the bleed resistors as PackWire.hear has it."""
        lib.pack_wire_bleed(heard, ffi.addressof(self.fields, "plant"))

    @property
    def current_A(self) -> float:
        """Current that flows, negative while charging."""
        return float(self.fields.current_A)

    def voltage_V(self, cell: int) -> float:
        """True voltage of a cell in V with the present current."""
        if cell in self._foreign.plants:
            return self._foreign.voltage_V(cell)
        plant = ffi.addressof(self.fields, "plant")
        return float(lib.plant_voltage_V(plant, cell, self.fields.current_A))

    def core_K(self) -> list[float]:
        """True core temperature of each cell in K."""
        cells = self.fields.plant.cell
        return [float(cells[i].memory.state.core) for i in range(self._settings.cells)]

    def socs(self) -> list[float]:
        """True state of charge of each cell."""
        cells = self.fields.plant.cell
        return [float(cells[i].memory.state.soc) for i in range(self._settings.cells)]

    def peaks(self) -> Any:
        """Greatest state of charge, core and surface temperature and voltage of each cell."""
        peaks = self._charge.peaks()
        for cell, one in self._foreign.plants.items():
            most = one.extremes
            peaks[cell] = (
                most.soc,
                most.core_temperature_K,
                most.surface_temperature_K,
                most.voltage_V,
            )
        return peaks

    def least_anode_V(self) -> float | None:
        """Least anode potential of any cell that has electrodes, in V; None without one."""
        least = [one.extremes.min_anode_potential_V for one in self._foreign.plants.values()]
        return min((value for value in least if value is not None), default=None)


class PackWire:
    """The plant's frames of a control period, and what it makes of the ECU's."""

    def __init__(self, settings: PackChargeSettings, plant: PackPlant) -> None:
        self._plant = plant
        self._thermistors = len(settings.view.thermistors)
        self._wire = ffi.new("pack_wire_t *")
        self._frames = ffi.new("can_frame_t[]", lib.PACK_WIRE_MOST)
        self._socs = ffi.new("float[]", plant.socs())
        self._asked = ffi.new(
            "pack_asked_t *",
            {
                "cells": settings.cells,
                "reference_current_A": settings.preset.limits.reference_current_A,
                "plug_in_soc": self._socs,
            },
        )
        nothing = [float("nan")] * lib.BMS_MAX_CELLS
        self.heard: Any = ffi.new(
            "pack_heard_t *",
            {
                "core_K": nothing,
                "soc": nothing,
                "highest_soc": nothing[0],
                "lowest_soc": nothing[0],
            },
        )
        self.heard.state = self.heard.first_fault = _UNSAID
        self.sync = Frame(lib.PACK_SYNC_ID, b"")

    def publish(self, charge: bool, request: int | None = None) -> list[Frame]:
        """The frames of a period up to SYNC, of what was measured last.

        `request` is a code to send in place of that for charge or off.
        """
        code = lib.REQUEST_CHARGE if charge else lib.REQUEST_OFF
        self._asked.request = code if request is None else request
        plant = self._plant
        count = lib.pack_wire_publish(
            self._wire,
            plant.measured,
            plant.pack_voltage_V,
            self._thermistors,
            self._asked,
            self._frames,
        )
        return [*unpacked(self._frames, count), self.sync]

    def hear(self, frames: list[Frame]) -> Any:
        """What the ECU has said, after the frames of a period's answer."""
        content = packed(frames)
        lib.pack_wire_hear(
            self._wire,
            ffi.from_buffer("can_frame_t[]", content),
            len(content) // FRAME.size,
            self.heard,
        )
        return self.heard


def obeyed_A(heard: Any) -> float | None:
    """What the charger obeys: none of several commands, and no number that it cannot read."""
    if heard.is_contested:
        return 0.0
    return None if math.isnan(heard.command_A) else float(heard.command_A)
