"""What a pack's true plant admits: currents held for a time on a copy of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from bms.arrays import Array
from hil_sim.pack.plant import PackPlant
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import SUB_STEPS, peak_limits

_HALVINGS = 12


class Ahead:
    """Looks ahead from where a plant is; the plant itself stays as it is.

    Of foreign cells it sees the stand-ins.
    """

    def __init__(self, settings: PackChargeSettings, plant: PackPlant, time_s: float) -> None:
        self._plant = plant
        self._limits = peak_limits(settings.preset)
        self._strongest_A = settings.preset.limits.reference_current_A
        self._cells = ffi.new("plant_cell_t[]", settings.cells)
        self._copy: Any = ffi.new("plant_t *")
        periods = round(time_s / settings.preset.timing.sampling_period_s)
        self._steps = periods * SUB_STEPS

    def over(self, current_A: float) -> Array:
        """By how much state of charge, core, surface, voltage of any cell exceed their limits."""
        true = self._plant.fields.plant
        count = true.cells
        ffi.memmove(self._cells, true.cell, ffi.sizeof(self._cells))
        ffi.memmove(self._copy, ffi.addressof(self._plant.fields, "plant"), ffi.sizeof("plant_t"))
        self._copy.cell = self._cells
        for i in range(count):
            self._cells[i].peaks = (0.0, 0.0, 0.0, 0.0)
        lib.plant_hold(self._copy, current_A, self._steps)
        peaks = [self._cells[i].peaks for i in range(count)]
        highest = np.array(
            [(p.soc, p.core_temperature_K, p.surface_temperature_K, p.voltage_V) for p in peaks]
        ).max(axis=0)
        return np.asarray(highest - self._limits)

    def strongest_A(self) -> float:
        """Strongest current, to a 4096th of the preset's, that crosses no limit."""
        if (self.over(self._strongest_A) <= 0.0).all():
            return self._strongest_A
        admitted_A, refused_A = 0.0, self._strongest_A
        for _ in range(_HALVINGS):
            middle_A = 0.5 * (admitted_A + refused_A)
            if (self.over(middle_A) <= 0.0).all():
                admitted_A = middle_A
            else:
                refused_A = middle_A
        return admitted_A
