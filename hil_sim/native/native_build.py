"""Builds hil_sim.native._native: the cell, the plant's frames and batches of frames in C."""

from __future__ import annotations

from bms.native_build import CORE_FOLDERS, CORE_HEADERS, NativeExtension

NATIVE_FOLDER = "hil_sim/native"
NATIVE = NativeExtension(
    module="hil_sim.native._native",
    folders=(*CORE_FOLDERS, NATIVE_FOLDER),
    headers=(
        *CORE_HEADERS,
        *(f"{NATIVE_FOLDER}/{name}.h" for name in ("cell", "wire", "socketcan_batch")),
    ),
)
