"""The control core of packs by itself: readings in, one step, decision out."""

from __future__ import annotations

import math

from bms.model.pair import load_pair
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import NO_THERMISTOR, Core
from hil_sim.studies.pack.reserves import NO_RESERVES, Reserves, reserves
from hil_sim.studies.pack.spread import Spread, Surroundings

CHARGING = (2, 3)


def core_of(preset_name, kept=None):
    """Core with the preset's own constants, or with the reserves of the ordinary spread."""
    preset, model = load_pair(preset_name, None)
    if kept is None:
        kept = NO_RESERVES
    return Core(preset, model, kept)


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

    def start(self, settle=400):
        """Settle, then ask for a charge."""
        self.step(settle, charge=False)
        self.step(1, charge=True)
        assert self.pack.state in CHARGING, self.pack.state
        return self

    def own_decision(self, cell, reference_A):
        """What one cell by itself admits."""
        return lib.pack_cell_decision(self.pack, self.given(), cell, reference_A)

    @property
    def decision(self):
        return self.pack.decision.decision


def same(a, b):
    """Whether two floats are the same bits, or both no number."""
    return a == b or (math.isnan(a) and math.isnan(b))


def with_changes(preset_name, **changes):
    """A core with some constants of the controller set to other values."""
    return core_of(preset_name, Reserves(changes, {}))
