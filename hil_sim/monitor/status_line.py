"""The state of the system in one line, for pipes and files."""

from __future__ import annotations

from hil_sim.monitor import wording
from hil_sim.monitor.model import Snapshot
from hil_sim.monitor.presets import PresetInForce
from hil_sim.monitor.quantities import quantities


def status_line(time_s: float, snapshot: Snapshot, in_force: PresetInForce) -> str:
    """State, values with their limits, decision, faults and foreign frames at a time in s."""
    readings = snapshot.readings
    parts = [_marked(wording.state(snapshot), readings["DiagnosticState"].is_stale)]
    for quantity in quantities(snapshot, in_force.preset):
        text = f"{quantity.label} {quantity.text} (limit {quantity.limit_text})"
        parts.append(_marked(text, quantity.reading.is_stale))
    decision = {
        "CommandCurrent": f"command {wording.quantity(readings['CommandCurrent'], 3, 'A')}",
        "LowerCurrent": f"admitted {wording.interval(snapshot)}",
        "ActiveConstraint": f"constraint {wording.constraint(snapshot)}",
        "ActiveFaults": f"active {wording.fault_names(snapshot.faults('ActiveFaults'))}",
        "LatchedFaults": f"latched {wording.fault_names(snapshot.faults('LatchedFaults'))}",
    }
    parts += [_marked(text, readings[signal].is_stale) for signal, text in decision.items()]
    parts.append(f"foreign {snapshot.foreign.frames}")
    if in_force.remark:
        parts.append(in_force.remark)
    return f"{time_s:.1f} s  " + "; ".join(parts)


def _marked(text: str, is_stale: bool) -> str:
    return f"{text} stale" if is_stale else text
