"""Why the boot stage of an image does not start the application, as it says on the bus."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.bus.catalog import FailedCheck, RefusedPart

_ANEW = "flash it anew"
_POWER = "take its power away and find out why it restarts"
_REMEDIES: Mapping[float | None, str] = {
    FailedCheck.ROLLED_BACK: "flash a newer one, or this one by 'bms flash --allow-older'",
    FailedCheck.REPEATED_FAULTS: _POWER,
    FailedCheck.REPEATED_WATCHDOG: _POWER,
    FailedCheck.REPEATED_RESETS: _POWER,
}


def refusal_text(part: float | None, check: float | None) -> str:
    """In words, by the values of RefusedPart and FailedCheck; None where one is not available."""
    refused, reason = _words(RefusedPart, part), _words(FailedCheck, check)
    return f"its boot stage refuses the {refused} ({reason}); {_REMEDIES.get(check, _ANEW)}"


def _words(names: type[RefusedPart] | type[FailedCheck], value: float | None) -> str:
    label = {choice.value: choice.label for choice in names}.get(int(value or 0), f"number {value}")
    return label.replace("_", " ")
