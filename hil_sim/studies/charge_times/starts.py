"""The starts from which every controller charges the nominal cell."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bms.presets import Preset, load_preset
from bms.presets.schema import Initial
from bms.studies.optimum.charge import Charge, charge_of

PRESETS = ("paper_calibrated", "lin2014")
TEMPERATURES_K = (283.0, 298.0, 313.0)
SOCS = (0.01, 0.5)
COOLING_SHARES = (0.5, 1.0)
"""Of the preset's cooling power: a low and the nominal one."""


@dataclass(frozen=True)
class Start:
    """A cell of a preset at rest, with coolant of its own temperature."""

    preset: str
    temperature_K: float
    soc: float
    cooling_share: float

    @property
    def name(self) -> str:
        """What tells it from others, as in the table."""
        return f"{self.preset} {self.temperature_K:g} K, SoC {self.soc:g}, {self.cooling_text}"

    @property
    def cooling_text(self) -> str:
        """The cooling in words."""
        return "nominal" if self.cooling_share == 1.0 else f"{self.cooling_share:g} x"

    def loaded(self) -> Preset:
        """The preset, its charges beginning here. Raises InputError as load_preset does."""
        preset = load_preset(self.preset)
        cooling_W = self.cooling_share * preset.initial.cooling_power_W
        return replace(preset, initial=Initial(self.soc, self.temperature_K, cooling_W))

    def charge(self) -> Charge:
        """What the bound is computed of, with ramp and map."""
        return charge_of(self.loaded())


def all_starts() -> list[Start]:
    """The 24 of the table."""
    return [
        Start(preset, temperature_K, soc, share)
        for preset in PRESETS
        for temperature_K in TEMPERATURES_K
        for soc in SOCS
        for share in COOLING_SHARES
    ]
