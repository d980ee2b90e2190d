"""The machine-checked argument of `bms verify`, put together for a preset and a model."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bms.barrier.margins import decision_allowances
from bms.barrier.readings import reading_errors
from bms.barrier.rounding import ARITHMETIC_ROUNDINGS
from bms.bus_signals import BUS
from bms.model.model_file import KanModel
from bms.model.start import unknown_start
from bms.presets import Preset
from bms.verification.barriers import Barrier
from bms.verification.certificate import Certificate
from bms.verification.conditions import (
    chains,
    decided_conditions,
    firmware_constants,
    required_conditions,
)
from bms.verification.domain import Domain, certified_domain
from bms.verification.electrical import certify_soc, certify_voltage
from bms.verification.fallback import Fallback, infeasible_part
from bms.verification.findings import Finding, obstacles, refusal
from bms.verification.search import SAMPLES, CounterExample, find_counter_example
from bms.verification.slips import Slip, with_slips
from bms.verification.thermal import Case, certify

LARGEST_BOXES = 400_000
PARTS = 4
"""Of a verification: what is electrical, the core, and the surface with two chains."""
ESTIMATE = "estimate"
"""What is refused beside the barriers: a model that does not know how a charge begins."""
MARGINS = {
    "voltage": "voltage_margin_V",
    "soc": "soc_margin_per_s",
    "core": "core_margin_K_per_s",
    "surface": "surface_margin_K_per_s2",
}
"""Names of the constants by what certificates are of."""


@dataclass(frozen=True)
class BarrierResult:
    """One barrier: its certificate, a counter-example to it, and one outside its domain.

    The two thermal barriers have a domain narrower than the operating box; `outside` is a safe
    state of the box beyond it from which a simulated decision crosses the barrier, if one is found.
    """

    name: str
    certificate: Certificate
    domain: Domain | None
    counter_example: CounterExample | None
    outside: CounterExample | None


@dataclass(frozen=True)
class Verification:
    """What was shown of a preset's decisions; `certified` when every barrier is.

    `refusals` say why not, by the barrier's name or ESTIMATE; `obstacles` what keeps a charge, safe
    as it is, from beginning or from being finished.
    """

    preset: str
    model: str
    slips: tuple[str, ...]
    held_s: float
    error_bound_K: float
    margins: Mapping[str, float]
    barriers: tuple[BarrierResult, ...]
    refusals: Mapping[str, Finding]
    fallback: Fallback
    obstacles: tuple[Finding, ...]
    wall_time_s: float

    @property
    def certified(self) -> bool:
        """Whether every barrier is kept, no simulated decision contradicts it, a charge begins."""
        return not self.refusals

    def as_dict(self) -> dict[str, Any]:
        """Content for JSON: plain numbers, lists and mappings."""
        return {
            "preset": self.preset,
            "model": self.model,
            "formulas": list(self.slips) or "corrected",
            "certified": self.certified,
            "held_s": self.held_s,
            "estimation_error_bound_K": self.error_bound_K,
            "margins": dict(self.margins),
            "boxes": sum(b.certificate.boxes for b in self.barriers),
            "wall_time_s": self.wall_time_s,
            "barriers": {b.name: _barrier_dict(b) for b in self.barriers},
            "refusals": {name: asdict(finding) for name, finding in self.refusals.items()},
            "without_safe_current": asdict(self.fallback),
            "obstacles": [asdict(obstacle) for obstacle in self.obstacles],
        }


def verify(
    preset: Preset,
    model: KanModel,
    slips: tuple[Slip, ...] = (),
    largest_boxes: int = LARGEST_BOXES,
    samples: int = SAMPLES,
    note: Callable[[str], None] = lambda part: None,
) -> Verification:
    """Certify the four barriers over one decision for the firmware's own constants.

    With slips, for constants that contain them; a barrier is given up beyond largest_boxes, and
    each search for a counter-example draws so many samples. `note` is told which of the PARTS comes
    next. Raises what loading the calibration raises.
    """
    begin = time.monotonic()
    note("voltage, state of charge and domains")
    constants = with_slips(preset, firmware_constants(preset, model), slips)
    errors = reading_errors(preset)
    cases = thermal_cases(preset, constants)

    def search(domain: Domain, barrier: Barrier) -> CounterExample | None:
        random = np.random.default_rng(0)
        return find_counter_example(domain, constants, errors, barrier, random, samples)

    core_domain, surface_domain = cases[0][0], cases[1][0]
    voltage, _ = certify_voltage(preset, constants)
    voltage_example = search(core_domain, Barrier.VOLTAGE)
    results = [
        BarrierResult("voltage", voltage, None, voltage_example, None),
        BarrierResult("soc", certify_soc(preset, constants), None, None, None),
    ]
    for domain, case in cases:
        name = _name(domain, case.barrier)
        note(name)
        results.append(
            BarrierResult(
                name,
                certify(domain, case, errors, largest_boxes),
                domain,
                search(domain, case.barrier),
                search(replace(domain, flows=()), case.barrier),
            )
        )
    slip_names = tuple(slip.name for slip in slips)
    refusals = {}
    for result in results:
        margin = MARGINS[result.certificate.name]
        finding = refusal(
            result.certificate, result.counter_example, (margin, constants[margin]), slip_names
        )
        if finding is not None:
            refusals[result.name] = finding
    start = unknown_start(preset, model)
    if start is not None:
        refusals[ESTIMATE] = Finding(start.reason, start.inputs, start.change)
    fallback = infeasible_part(surface_domain, decided_conditions(constants))
    return Verification(
        preset=preset.name,
        model=model.hash[:8],
        slips=slip_names,
        held_s=core_domain.held_s,
        error_bound_K=constants["estimation_error_bound_K"],
        margins={name: constants[name] for name in MARGINS.values()},
        barriers=tuple(results),
        refusals=refusals,
        fallback=fallback,
        obstacles=obstacles(preset, constants, fallback),
        wall_time_s=time.monotonic() - begin,
    )


def thermal_cases(preset: Preset, constants: Mapping[str, Any]) -> list[tuple[Domain, Case]]:
    """The core barrier, then the surface barrier by both of its chains, with their domains."""
    core, surface = required_conditions(preset)
    decided_core, decided_surface = decided_conditions(constants)
    allowances = decision_allowances(preset.cell, preset, BUS, ARITHMETIC_ROUNDINGS)
    loose, strict = chains(preset)
    gain_per_s = preset.gains.core_gain_per_s(preset.cell)
    core_case = Case(Barrier.CORE, core, decided_core, gain_per_s, allowances.core_K_per_s)
    cases = [(loose, core_case)]
    # Where the chain holds the disturbance's worst case, it was made for the loose one alone.
    both = preset.gains.surface_condition == "paper"
    for chain in (loose, strict) if both else (loose,):
        decay_per_s, allowance = chain.second_per_s, allowances.surface_K_per_s2
        case = Case(Barrier.SURFACE, surface, decided_surface, decay_per_s, allowance)
        cases.append((chain, case))
    return [(certified_domain(preset, case.required, chain), case) for chain, case in cases]


def _name(domain: Domain, barrier: Barrier) -> str:
    name: str = barrier.value
    if barrier is Barrier.SURFACE:
        return f"{name}, psi = B4' + {domain.chain.first_per_s:.3g} B4"
    return name


def _barrier_dict(result: BarrierResult) -> dict[str, Any]:
    certificate, domain = result.certificate, result.domain
    content: dict[str, Any] = {
        "certified": certificate.holds,
        "boxes": certificate.boxes,
        "open_boxes": certificate.open_boxes,
        "by_history": certificate.by_history,
    }
    if certificate.open_low is not None and certificate.open_high is not None:
        content["open_part"] = {
            name: [low, high]
            for name, low, high in zip(
                certificate.open_low._fields, certificate.open_low, certificate.open_high
            )
        }
    if domain is not None:
        content["domain"] = {
            "box": {
                name: [float(low), float(high)]
                for name, low, high in zip(domain.low._fields, domain.low, domain.high)
            },
            "core_gap_K": list(domain.core_gap_K),
            "coolant_gap_K": list(domain.coolant_gap_K),
            "flow_limits": [asdict(flow) for flow in domain.flows],
        }
    for name in ("counter_example", "outside"):
        part = getattr(result, name)
        content[name] = None if part is None else asdict(part)
    return content
