"""`bms export`: what the firmware takes from a model and a preset, the C core, units by FMI."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from bms.commands import options
from bms.errors import InputError, ModelMismatchError
from bms.image import calibration_part
from bms.model.model_file import KanModel
from bms.model.pair import load_pair
from bms.model.start import unknown_start
from bms.presets import DEFAULT_PRESET, Preset
from codegen.calibration_source import CALIBRATION_FILE, calibration_source
from codegen.can_sources import can_sources
from codegen.core_sources import core_sources, write_core
from codegen.rendering import write_files
from hil_sim.fmu.ecu import ECU_FILE, ecu_unit
from hil_sim.fmu.plant import PLANT_FILES, plant_unit


class UnitKind(str, Enum):
    """What there is as a unit for co-simulation, by its name on the command line."""

    ECU = "ecu"
    PLANT = "plant"


def export(
    out: Annotated[
        Path | None,
        options.out_folder_option(
            "the generated C sources and calibration.bin, or the units of --fmu", default=None
        ),
    ] = None,
    sources: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the whole C core, to be built by CMake; created when absent."
        ),
    ] = None,
    fmu: Annotated[
        list[UnitKind] | None,
        typer.Option(
            "--fmu",
            help="Write this unit for co-simulation to --out instead of the sources: ecu is the "
            "firmware on a CAN network, plant the preset's cell. May be repeated.",
        ),
    ] = None,
    preset: options.PresetOption = DEFAULT_PRESET,
    model: options.ModelOption = None,
) -> None:
    """Write what the firmware takes from a model, the C core with it, or units for co-simulation.

    With --out: controller constants, KAN tables and CAN codec as C sources; calibration.bin holds
    the same constants and tables for 'bms flash --calibration'. With --sources: headers and sources
    of the core with these generated ones, a CMakeLists.txt and a README that says how to call it.
    With --fmu ecu: ecu.fmu, FMI 3.0 with FMI-LS-BUS; with --fmu plant: plant_fmi2.fmu and
    plant_fmi3.fmu. A unit is compiled by the C compiler of this machine.

    Temperatures in K, currents in A (negative while charging), times in s.

    Example: bms export --model model.json --preset paper_calibrated --out out/export
    """
    if out is None and sources is None:
        raise InputError("export: no folder is named; add --out DIR, --sources DIR or both")
    if out is None and fmu:
        raise InputError(f"export: --fmu {fmu[0].value} needs a folder for the unit; add --out DIR")
    chosen, estimator = load_pair(preset, model)
    start = unknown_start(chosen, estimator)
    if start is not None:
        raise ModelMismatchError(f"--model {model}: {start.reason}; {start.change}")
    generated: dict[str, str | bytes] = {}
    if fmu:
        generated = {**_units(fmu, chosen, estimator)}
    elif out is not None:
        generated = {
            **can_sources(),
            **calibration_source(chosen, estimator),
            CALIBRATION_FILE: calibration_part(chosen, estimator),
        }
    core = core_sources(chosen, estimator) if sources is not None else {}
    written: list[Path] = []
    if out is not None:
        written += write_files(out, generated)
    if sources is not None:
        written += write_core(sources, core)
    for path in written:
        print(path)


def _units(kinds: list[UnitKind], preset: Preset, model: KanModel) -> dict[str, bytes]:
    units: dict[str, bytes] = {}
    if UnitKind.ECU in kinds:
        units[ECU_FILE] = ecu_unit(preset, model)
    if UnitKind.PLANT in kinds:
        units |= {name: plant_unit(preset, version) for version, name in PLANT_FILES.items()}
    return units
