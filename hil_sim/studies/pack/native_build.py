"""Builds hil_sim.studies.pack._pack: a pack in closed loop in C, for a host only.

Around the firmware's own sources, its core and its ECU for packs, and the simulator's cell.
"""

from __future__ import annotations

from bms.native_build import CORE_FOLDERS, CORE_HEADERS, NativeExtension
from hil_sim.native.native_build import NATIVE_FOLDER

_NATIVE = "hil_sim/studies/pack/native"
PACK = NativeExtension(
    module="hil_sim.studies.pack._pack",
    folders=(
        *CORE_FOLDERS,
        *("firmware_c/pack", "firmware_c/pack/generated", "firmware_c/pack_ecu"),
        NATIVE_FOLDER,
        _NATIVE,
    ),
    headers=(
        *CORE_HEADERS,
        "firmware_c/pack/pack.h",
        "firmware_c/pack/pack_function.h",
        "firmware_c/pack/generated/pack_catalog.h",
        "firmware_c/pack_ecu/pack_ecu.h",
        f"{NATIVE_FOLDER}/cell.h",
        *(f"{_NATIVE}/{name}.h" for name in ("plant", "pack_charge", "pack_wire")),
    ),
)
