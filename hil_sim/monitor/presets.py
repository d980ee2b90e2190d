"""Whose limits to show: those of the preset whose hash the ECU sends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bms.presets import Preset, load_preset, preset_names
from hil_sim.bus.identity import Identity

_DIGITS = 4


@dataclass(frozen=True)
class PresetInForce:
    """The ECU's preset as far as it is known, and a remark when something is amiss."""

    preset: Preset | None
    remark: str = ""


class PresetFinder:
    """Knows the shipped presets and the one that was given, if any."""

    def __init__(self, given: Preset | None, shipped: Sequence[Preset]) -> None:
        self._given = given
        self._known = [*([given] if given else []), *shipped]

    def find(self, identity: Identity | None, refusal: str | None = None) -> PresetInForce:
        """The preset that the identity names; without one, no limits, whatever was given.

        `refusal` is what the boot stage says where it does not start the application.
        """
        if refusal is not None:
            return PresetInForce(None, f"the ECU does not start: {refusal}")
        if identity is None:
            return PresetInForce(None, "no Identity yet: limits unknown")
        if identity.other_version is not None:
            return PresetInForce(None, f"the ECU speaks {identity.other_version}")
        wanted = identity.preset_hash
        preset = next((known for known in self._known if known.hash.startswith(wanted)), None)
        if self._given is not None and preset is not self._given:
            mismatch = (
                f"--preset {self._given.name} ({self._given.hash[:_DIGITS]}) is not the ECU's"
            )
            remark = mismatch if preset is not None else f"{mismatch}: limits unknown"
        elif preset is None:
            remark = "preset unknown, give --preset FILE for its limits"
        else:
            remark = ""
        return PresetInForce(preset, remark)


def preset_finder(given: str | None) -> PresetFinder:
    """A finder with the shipped presets; InputError when the given one cannot be loaded."""
    return PresetFinder(
        None if given is None else load_preset(given), [load_preset(n) for n in preset_names()]
    )
