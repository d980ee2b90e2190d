"""Which firmware, model and preset an ECU says that it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Identity:
    """Content of an Identity message; hashes as their first hexadecimal digits."""

    firmware_version: int
    model_hash: str
    preset_hash: str

    @classmethod
    def of(cls, value: Callable[[str], float | None]) -> Identity | None:
        """From a function that gives the value of a signal; None before the message has come."""
        model, preset, version = map(value, ("ModelHash", "PresetHash", "FirmwareVersion"))
        if model is None or preset is None or version is None:
            return None
        return cls(int(version), f"{int(model):08x}", f"{int(preset):04x}")
