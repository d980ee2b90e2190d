"""The control core of packs by itself: readings in, one step, decision out."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bms.cell import CellState, Disturbance, scaled
from bms.model.pair import load_pair
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import NO_THERMISTOR, Core, PackCharge, all_cells
from hil_sim.studies.pack.reserves import NO_RESERVES, reserves
from hil_sim.studies.pack.spread import PackDraw, Spread, Surroundings

CHARGING = (2, 3)


@cache
def core_of(preset_name):
    """Core with the preset's own constants."""
    preset, model = load_pair(preset_name, None)
    return Core(preset, model, NO_RESERVES)


def ordinary(preset_name):
    """Reserves of the ordinary spread."""
    return reserves(load_pair(preset_name, None)[0], Spread(), Surroundings())


class PackRig:
    """A pack_t with readings that a test sets; `surfaces` are those of the thermistors."""

    def __init__(self, core, cells, bare=(), thermistors=None):
        owners = [i for i in range(cells) if i not in bare]
        count = len(owners) if thermistors is None else thermistors
        of = [owners.index(i) if i in owners else NO_THERMISTOR for i in range(cells)]
        self.core, self.cells = core, cells
        self.pack = ffi.new("pack_t *")
        self._map = ffi.new("uint8_t[]", of)
        config = {
            "calibration": core.calibration,
            "cells": cells,
            "thermistors": count,
            "thermistor_of": self._map,
            "bare": core.reserves.bare,
        }
        lib.pack_init(self.pack, ffi.new("pack_config_t *", config))
        start = core.preset.initial
        voltage = core.preset.cell.ocv(start.soc)
        self.readings = {
            "current_A": 0.0,
            "coolant_in_K": start.temperature_K,
            "coolant_out_K": start.temperature_K,
            "cooling_power_W": start.cooling_power_W,
            "charge": False,
            "reference_current_A": core.preset.limits.reference_current_A,
        }
        self.voltages = [voltage] * cells
        self.surfaces = [start.temperature_K] * count
        self.socs = [start.soc] * cells

    def given(self):
        """The readings in C; the arrays are kept while they are used."""
        self._arrays = [
            ffi.new("float[]", values) for values in (self.voltages, self.surfaces, self.socs)
        ]
        voltage, surface, soc = self._arrays
        return ffi.new(
            "pack_readings_t *",
            self.readings
            | {"voltage_V": voltage, "surface_temperature_K": surface, "plug_in_soc": soc},
        )

    def step(self, periods=1, **changes):
        """Run periods with changed readings; the command of the last one in A."""
        self.readings |= changes
        given = self.given()
        for _ in range(periods):
            lib.pack_step(self.pack, given)
        return self.pack.command_A

    def own_decision(self, cell, reference_A):
        """What one cell by itself admits."""
        return lib.pack_cell_decision(self.pack, self.given(), cell, reference_A)

    @property
    def decision(self):
        return self.pack.decision.decision


def same(a, b):
    """Whether two floats are the same bits, or both no number."""
    return a == b or (math.isnan(a) and math.isnan(b))


class PackLoop(PackRig):
    """A rig whose readings come from a plant of coupled cells, with noise; one core, any order."""

    def __init__(self, core, factors, soc=0.5, temperature_K=308.0, order=None, noise=1.0):
        """`factors` are those of each cell; `order` is where in the core's string each stands."""
        super().__init__(core, len(factors))
        self.order = list(range(self.cells)) if order is None else order
        states = (CellState(soc, *[temperature_K] * 3),) * self.cells
        cells = tuple(scaled(core.preset.cell, factor) for factor in factors)
        draw = PackDraw(cells, states, (Disturbance(),) * self.cells)
        self._charge = PackCharge(core, draw, Surroundings(), all_cells(self.cells), 3600.0)
        self.plant = ffi.addressof(self._charge.fields, "plant")
        self.plant.cooling_power_W = 1.0
        self._rng, self._noise, self.socs = np.random.default_rng(1), noise, [soc] * self.cells
        self.run(20)
        self.readings["charge"] = True
        self.run(1)
        assert self.pack.state in CHARGING, self.pack.state

    def run(self, periods):
        """Closed loop; the commands in A."""
        return [self._period() for _ in range(periods)]

    def _period(self):
        current_A = self.pack.command_A
        lib.plant_hold(self.plant, current_A, 10)
        normals = self._noise * self._rng.standard_normal((2, self.cells))
        for cell, place in enumerate(self.order):
            state = self.plant.cell[cell].memory.state
            self.voltages[place] = (
                lib.plant_voltage_V(self.plant, cell, current_A) + 5e-4 * normals[0, cell]
            )
            self.surfaces[place] = state.surface + 5e-3 * normals[1, cell]
        coolants = [self.plant.cell[i].memory.state.coolant for i in range(self.cells)]
        mean_K = float(np.mean(coolants))  # one for all, whatever their order
        return self.step(
            current_A=current_A, coolant_in_K=mean_K, coolant_out_K=mean_K, cooling_power_W=1.0
        )
