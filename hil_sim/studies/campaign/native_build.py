"""Builds hil_sim.studies.campaign._runner: charges in closed loop in C, for a host only.

Around the firmware's own sources and the simulator's cell.
"""

from __future__ import annotations

from bms.native_build import CORE_FOLDERS, CORE_HEADERS, NativeExtension
from hil_sim.native.native_build import NATIVE_FOLDER

_NATIVE = "hil_sim/studies/campaign/native"
RUNNER = NativeExtension(
    module="hil_sim.studies.campaign._runner",
    folders=(*CORE_FOLDERS, NATIVE_FOLDER, _NATIVE),
    headers=(
        *CORE_HEADERS,
        f"{NATIVE_FOLDER}/cell.h",
        *(f"{_NATIVE}/{name}.h" for name in ("ecu_link", "baselines", "charge")),
    ),
)
