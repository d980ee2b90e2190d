"""Which firmware, model and preset an ECU says that it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.bus.catalog import NETWORK_VERSION


@dataclass(frozen=True)
class Identity:
    """Content of an Identity message; hashes as their first hexadecimal digits."""

    network_version: int
    """That of the CAN database by which its frames are laid out."""
    firmware_version: int
    model_hash: str
    preset_hash: str

    @classmethod
    def of(cls, value: Callable[[str], float | None]) -> Identity | None:
        """From a function that gives the value of a signal; None before the message has come."""
        signals = ("ModelHash", "PresetHash", "FirmwareVersion", "NetworkVersion")
        if value(signals[0]) is None:
            return None
        model, preset, firmware, network = map(value, signals)
        if model is None or preset is None or firmware is None or network is None:
            return None
        # Version 1 had no such signal: half of its firmware version, which was 0.
        return cls(int(network) or 1, int(firmware), f"{int(model):08x}", f"{int(preset):04x}")

    @property
    def other_version(self) -> str | None:
        """What is wrong where the frames are laid out by another version of the database than here.

        Without remedy, which depends on where the frames come from.
        """
        if self.network_version == NETWORK_VERSION:
            return None
        return (
            f"version {self.network_version} of the CAN database, of which this bms has "
            f"version {NETWORK_VERSION}"
        )
