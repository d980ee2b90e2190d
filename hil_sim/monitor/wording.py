"""Readings as text; what is not there is n/a."""

from __future__ import annotations

from hil_sim.bus.catalog import FirstFault
from hil_sim.monitor.model import Reading, Snapshot

NOT_AVAILABLE = "n/a"


def quantity(reading: Reading, digits: int, unit: str, scale: float = 1.0) -> str:
    """A value with its unit, or n/a."""
    if reading.value is None:
        return NOT_AVAILABLE
    return f"{reading.value * scale:.{digits}f} {unit}"


def core_estimate(snapshot: Snapshot) -> str:
    """The estimated core temperature with its error bound in K."""
    core, bound = snapshot.readings["CoreTemperature"], snapshot.readings["ErrorBound"]
    if core.value is None:
        return NOT_AVAILABLE
    error = "" if bound.value is None else f" ± {bound.value:.2f}"
    return f"{core.value:.2f}{error} K"


def interval(snapshot: Snapshot) -> str:
    """The currents that the constraints admit, in A."""
    lower, upper = (snapshot.readings[name].value for name in ("LowerCurrent", "UpperCurrent"))
    if lower is None or upper is None:
        return NOT_AVAILABLE
    return f"{lower:.3f} … {upper:.3f} A"


def fault_names(names: list[str] | None) -> str:
    """Names of faults, 'none' without any, n/a when it is not known."""
    if names is None:
        return NOT_AVAILABLE
    return ", ".join(names) or "none"


def first_fault(snapshot: Snapshot) -> str:
    """Name of the first latched fault."""
    if snapshot.readings["FirstFault"].value == FirstFault.NONE:
        return FirstFault.NONE.label
    return snapshot.name("FirstFault") or NOT_AVAILABLE


def state(snapshot: Snapshot) -> str:
    """Name of the ECU's state, n/a before its first report."""
    return snapshot.name("DiagnosticState") or NOT_AVAILABLE


def constraint(snapshot: Snapshot) -> str:
    """Name of the constraint that decides, 'none' for free charging."""
    name = snapshot.name("ActiveConstraint")
    return NOT_AVAILABLE if name is None else name.lower()


def duration(time_s: float) -> str:
    """A time for a reader: hundredths, then seconds, minutes, hours."""
    if time_s < 9.995:
        return f"{time_s:.2f} s"
    if time_s < 99.5:
        return f"{time_s:.0f} s"
    if time_s < 99.5 * 60.0:
        return f"{time_s / 60.0:.0f} min"
    return f"{time_s / 3600.0:.0f} h"
