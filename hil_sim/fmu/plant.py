"""The cell of a preset as units of FMI 2.0 and 3.0."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bms.presets import Preset
from hil_sim.fmu.archive import archive, described, token_of
from hil_sim.fmu.library import compile_library
from hil_sim.fmu.plant_variables import Variable, plant_variables
from hil_sim.fmu.sources import (
    build_description,
    compiled_units,
    flat_sources,
    licence,
    source_folder,
)
from hil_sim.native.cell_fields import cell_fields
from hil_sim.plant.plant import SUB_STEPS
from hil_sim.plant.true_cell import nominal_cell

PLANT_FILES = {2: "plant_fmi2.fmu", 3: "plant_fmi3.fmu"}
IDENTIFIER = "kan_rcbf_plant"

_NATIVE = "hil_sim/fmu/native"
_SHARED = (
    *("hil_sim/native/cell.[ch]", f"{_NATIVE}/plant_unit.[ch]"),
    *(f"{_NATIVE}/plant_variables.h", f"{_NATIVE}/thermal_step.[ch]"),
)
_OF_VERSION = {
    2: (f"{_NATIVE}/plant_fmi2.c", f"{_NATIVE}/fmi2*.[ch]"),
    3: (f"{_NATIVE}/plant_fmi3.c", f"{_NATIVE}/fmi3*.[ch]"),
}
_UNITS = {
    "1": {},
    "A": {"A": 1},
    "A.h": {"A": 1, "s": 1, "factor": 3600},
    "J/K": {"kg": 1, "m": 2, "s": -2, "K": -1},
    "K": {"K": 1},
    "K/W": {"kg": -1, "m": -2, "s": 3, "K": 1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "V/K": {"kg": 1, "m": 2, "s": -3, "A": -1, "K": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "s": {"s": 1},
}
"""Unit -> exponents of the base units of the SI, and a factor on them."""


def plant_unit(preset: Preset, version: int) -> bytes:
    """The unit of FMI 2.0 or 3.0; InputError when the library cannot be built."""
    variables = plant_variables(preset)
    sources = flat_sources((*_SHARED, *_OF_VERSION[version]))
    sources["plant_preset.c"] = _preset_source(preset, variables)
    token = token_of(sources)
    sources["plant_token.h"] = f'#define PLANT_TOKEN "{token}"\n'.encode()
    platform = {2: "linux64", 3: "x86_64-linux"}[version]
    described_variables = [(i, v) for i, v in enumerate(variables) if v.is_present]
    contents = {
        "modelDescription.xml": described(
            f"plant_fmi{version}.xml.j2",
            token=token,
            identifier=IDENTIFIER,
            preset=preset,
            variables=described_variables,
            units=_UNITS,
            output_indices=[
                i for i, (_, v) in enumerate(described_variables, 1) if v.causality == "output"
            ],
            sources=compiled_units(sources),
            step_s=preset.timing.sampling_period_s,
        ),
        f"binaries/{platform}/{IDENTIFIER}.so": compile_library(sources),
        **source_folder(sources),
        "documentation/licenses/license.txt": licence(),
    }
    if version == 3:
        contents["sources/buildDescription.xml"] = build_description(IDENTIFIER, sources)
    return archive(contents)


def _preset_source(preset: Preset, variables: list[Variable]) -> bytes:
    """C source of the cell with its exact sub-step, and of the start values."""
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    fields = cell_fields(nominal_cell(preset).cell, step_s)
    starts = [0.0 if variable.start is None else variable.start for variable in variables]
    return (
        "/* The cell of a preset, written by `bms export --fmu plant`. */\n"
        '#include "plant_unit.h"\n\n'
        f"const cell_t PLANT_CELL = {_initialiser(fields)};\n\n"
        f"const double PLANT_START[PLANT_VARIABLES] = {_initialiser(starts)};\n"
    ).encode()


def _initialiser(value: Any) -> str:
    """C initialiser of mappings (designated), sequences and numbers, which read back exactly."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f".{name} = {_initialiser(v)}" for name, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "{" + ", ".join(_initialiser(item) for item in value) + "}" if value else "{0}"
    if isinstance(value, int):
        return f"{value}u"
    assert math.isfinite(value), value
    return repr(float(value))
