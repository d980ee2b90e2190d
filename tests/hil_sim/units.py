"""Units for co-simulation as tests need them: exported once, opened, edited."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from functools import lru_cache
from io import BytesIO
from pathlib import Path

from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from hil_sim.fmu.archive import archive
from hil_sim.fmu.ecu import ecu_unit
from hil_sim.fmu.plant import plant_unit

PRESET = "paper_calibrated"


@lru_cache
def exported_ecu() -> bytes:
    """The unit of the default preset; the library in it is the same for every preset."""
    return ecu_unit(load_preset(PRESET), load_shipped_model(PRESET))


@lru_cache
def exported_plant(version: int, preset: str = PRESET) -> bytes:
    """The plant's unit of FMI 2.0 or 3.0."""
    return plant_unit(load_preset(preset), version)


def opened(unit: bytes) -> dict[str, bytes]:
    """Path -> content of a unit."""
    with zipfile.ZipFile(BytesIO(unit)) as files:
        return {name: files.read(name) for name in files.namelist()}


def written(folder: Path, unit: bytes | Mapping[str, bytes], name: str = "unit.fmu") -> Path:
    """A unit as a file."""
    path = folder / name
    path.write_bytes(unit if isinstance(unit, bytes) else archive(unit))
    return path


def described(unit: bytes, edit: Callable[[str], str]) -> dict[str, bytes]:
    """A unit with an edited model description."""
    files = opened(unit)
    before = files["modelDescription.xml"].decode()
    after = edit(before)
    assert after != before
    return files | {"modelDescription.xml": after.encode()}
