"""The firmware as a unit of FMI 3.0 with a CAN network by FMI-LS-BUS."""

from __future__ import annotations

from bms.firmware.image_header import FIRMWARE_VERSION
from bms.image import calibration_part
from bms.model.model_file import KanModel
from bms.presets import Preset
from codegen.calibration_source import CALIBRATION_FILE
from codegen.can_database import database_text
from hil_sim.fmu.archive import archive, described, token_of
from hil_sim.fmu.library import compile_library
from hil_sim.fmu.sources import build_description, flat_sources, licence, source_folder

ECU_FILE = "ecu.fmu"
IDENTIFIER = "kan_rcbf_ecu"
NETWORK = "Can"
"""Name of the bus terminal, and of the network's description."""

_NATIVE = "hil_sim/fmu/native"
_SOURCES = (
    *("firmware_c/include/*.h", "firmware_c/src/*.[ch]", "firmware_c/image/*.[ch]"),
    *("firmware_c/generated/can_*.[ch]", "firmware_c/port/ecu_loop.[ch]", "firmware_c/port/port.h"),
    *(f"{_NATIVE}/bus_*.[ch]", f"{_NATIVE}/ecu_*.[ch]", f"{_NATIVE}/fmi3.h"),
    f"{_NATIVE}/fmi3_absent.c",
    f"{_NATIVE}/fmi3_common.c",
)


def ecu_unit(preset: Preset, model: KanModel) -> bytes:
    """The unit with the calibration of a preset and a model as a resource.

    Raises ModelMismatchError for a stale pair, and InputError when the firmware refuses a constant
    or the library cannot be built.
    """
    calibration = calibration_part(preset, model)
    sources = flat_sources(_SOURCES)
    token = token_of(sources)
    sources["ecu_token.h"] = f'#define ECU_TOKEN "{token}"\n'.encode()
    values = {"token": token, "identifier": IDENTIFIER, "network": NETWORK}
    bus_folder = "extra/org.fmi-standard.fmi-ls-bus"
    return archive(
        {
            "modelDescription.xml": described(
                "ecu_model.xml.j2", firmware_version=FIRMWARE_VERSION, **values
            ),
            "terminalsAndIcons/terminalsAndIcons.xml": described("ecu_terminals.xml.j2", **values),
            f"{bus_folder}/fmi-ls-manifest.xml": described("ecu_manifest.xml.j2"),
            f"{bus_folder}/{NETWORK}.dbc": database_text().encode(),
            f"resources/{CALIBRATION_FILE}": calibration,
            f"binaries/x86_64-linux/{IDENTIFIER}.so": compile_library(sources),
            **source_folder(sources),
            "sources/buildDescription.xml": build_description(IDENTIFIER, sources),
            "documentation/licenses/license.txt": licence(),
        }
    )
