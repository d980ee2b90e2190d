"""Builds hil_sim.studies.campaign._runner: charges in closed loop in C, for a host only.

Around the firmware's own sources.
"""

from __future__ import annotations

from bms.native_build import CORE_FOLDERS, CORE_HEADERS, NativeExtension

_NATIVE = "hil_sim/studies/campaign/native"
RUNNER = NativeExtension(
    module="hil_sim.studies.campaign._runner",
    folders=(*CORE_FOLDERS, _NATIVE),
    headers=(
        *CORE_HEADERS,
        *(f"{_NATIVE}/{name}.h" for name in ("cell", "ecu_link", "baselines", "charge")),
    ),
)
