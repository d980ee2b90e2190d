"""A pack as the WebAssembly module for packs takes it: the bytes of its pack_scenario_t.

Cells are drawn as `bms pack` draws those of its first pack; what the page charges is its first
controller, with a thermistor at each cell.
"""

from __future__ import annotations

import base64
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cffi import FFI

from bms.model.pair import load_pair
from bms.native_build import ROOT, declarations
from hil_sim.dashboard.module import PACK_HEADERS
from hil_sim.dashboard.page_data import limits_data
from hil_sim.dashboard.ziggurat import ziggurat_tables
from hil_sim.studies.pack._pack import ffi as pack_ffi
from hil_sim.studies.pack.engine import Core, PackCharge, all_cells
from hil_sim.studies.pack.reserves import reserves
from hil_sim.studies.pack.settings import PackSettings
from hil_sim.studies.pack.spread import draw_pack

CELLS = (1, 4, 16)
"""Packs that the page offers, by their cells."""
_COPIED = (
    "period_s", "max_time_s", "reference_current_A", "full_cooling_W", "coolant_floor_K",
    "cooling_band_K", "noise_cutoff", "off_periods",
)  # fmt: skip
_SENSORS = ("current", "voltage", "surface", "coolant", "power")


def pack_charge(settings: PackSettings) -> tuple[PackCharge, Core]:
    """The first pack of a study on its first controller, before its first period."""
    kept = reserves(settings.preset, settings.spread, settings.around)
    core = Core(settings.preset, settings.model, kept)
    first = np.random.SeedSequence(entropy=settings.seed, spawn_key=(0,)).spawn(3)[0]
    draws = np.random.Generator(np.random.Philox(first))
    drawn = draw_pack(settings.preset, settings.spread, settings.cells, draws, settings.disturbed)
    view = all_cells(settings.cells)
    return PackCharge(core, drawn, settings.around, view, settings.max_time_s), core


def packs_data(name: str, model_path: Path | None = None) -> dict[str, Any]:
    """Packs of a preset's cells with its model; InputError as load_pair and `reserves`."""
    preset, model = load_pair(name, model_path)
    return {
        "name": preset.name,
        "limits": limits_data(preset),
        "period_s": preset.timing.sampling_period_s,
        "packs": {
            str(cells): base64.b64encode(
                _scenario_bytes(PackSettings(preset, model, cells=cells))
            ).decode()
            for cells in CELLS
        },
    }


def _scenario_bytes(settings: PackSettings) -> bytes:
    charge, core = pack_charge(settings)
    fields, cells = charge.fields, settings.cells
    ffi = _layout()
    scenario = ffi.new(
        "pack_scenario_t *",
        {
            "normals": ziggurat_tables(),
            "cells": cells,
            "seed": settings.seed,
            "bare": core.reserves.bare,
            "plug_in_soc": [fields.plug_in_soc[i] for i in range(cells)],
            "neighbour_W_per_K": fields.plant.neighbour_W_per_K,
            "flow_W_per_K": fields.plant.flow_W_per_K,
            **{name: getattr(fields, name) for name in _COPIED},
            **{
                name: (getattr(fields, name).resolution, getattr(fields, name).noise_std)
                for name in _SENSORS
            },
        },
    )
    ffi.buffer(ffi.addressof(scenario, "calibration"))[:] = pack_ffi.buffer(core.calibration)
    size = cells * pack_ffi.sizeof("plant_cell_t")
    ffi.buffer(ffi.addressof(scenario, "cell"))[:size] = pack_ffi.buffer(fields.plant.cell, size)
    return bytes(ffi.buffer(scenario))


@cache
def _layout() -> FFI:
    layout = FFI()
    layout.cdef("\n".join(declarations(ROOT / header) for header in PACK_HEADERS))
    return layout
