"""Builds hil_sim.campaign._runner: closed-loop charges in C, around the firmware's own sources.

For a host only.
"""

from __future__ import annotations

from bms.native_build import CORE_FOLDERS, CORE_HEADERS, NativeExtension

_NATIVE = "hil_sim/campaign/native"
RUNNER = NativeExtension(
    module="hil_sim.campaign._runner",
    folders=(*CORE_FOLDERS, _NATIVE),
    headers=(
        *CORE_HEADERS,
        *(f"{_NATIVE}/{name}.h" for name in ("cell", "ecu_link", "baselines", "charge")),
    ),
    include="charge.h",
)
