"""The machine-checked argument of `bms verify`, put together for a preset and a model."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bms.barrier.rounding import rounding_allowances
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.verification.conditions import (
    chains,
    decided_conditions,
    firmware_constants,
    reading_errors,
    required_conditions,
)
from bms.verification.domain import Domain, certified_domain
from bms.verification.electrical import certify_soc, certify_voltage
from bms.verification.fallback import Fallback, infeasible_part
from bms.verification.search import CounterExample, find_counter_example
from bms.verification.slips import Slip, with_slips
from bms.verification.thermal import Case, Certificate, certify

LARGEST_BOXES = 400_000
MARGINS = (
    "voltage_margin_V",
    "soc_margin_per_s",
    "core_margin_K_per_s",
    "surface_margin_K_per_s2",
)


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
    """What was shown of a preset's decisions; `certified` when every barrier is."""

    preset: str
    model: str
    slips: tuple[str, ...]
    held_s: float
    error_bound_K: float
    margins: Mapping[str, float]
    barriers: tuple[BarrierResult, ...]
    fallback: Fallback
    wall_time_s: float

    @property
    def certified(self) -> bool:
        """Whether every barrier is kept and no simulated decision contradicts it."""
        return all(b.certificate.holds and b.counter_example is None for b in self.barriers)

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
            "without_safe_current": asdict(self.fallback),
        }


def verify(
    preset: Preset,
    model: KanModel,
    slips: tuple[Slip, ...] = (),
    largest_boxes: int = LARGEST_BOXES,
) -> Verification:
    """Certify the four barriers over one decision for the firmware's own constants.

    With slips, for constants that contain them; a barrier is given up beyond largest_boxes. Raises
    what loading the calibration raises.
    """
    begin = time.monotonic()
    constants = with_slips(preset, firmware_constants(preset, model), slips)
    errors = reading_errors(preset)
    core, surface = required_conditions(preset)
    decided_core, decided_surface = decided_conditions(constants)
    loose, strict = chains(preset)
    core_rounding, surface_rounding = rounding_allowances(preset.cell, preset)
    core_gain_per_s = preset.gains.core_gain_per_s(preset.cell)
    core_case = Case("core", core, decided_core, core_gain_per_s, core_rounding)
    cases = [
        (certified_domain(preset, core, loose), core_case),
        *(
            (
                certified_domain(preset, surface, chain),
                Case("surface", surface, decided_surface, chain.second_per_s, surface_rounding),
            )
            for chain in (loose, strict)
        ),
    ]
    voltage, _ = certify_voltage(preset, constants)
    voltage_example = find_counter_example(
        cases[0][0], constants, errors, "voltage", np.random.default_rng(0)
    )
    results = [
        BarrierResult("voltage", voltage, None, voltage_example, None),
        BarrierResult("soc", certify_soc(preset, constants), None, None, None),
    ]
    for domain, case in cases:
        whole = replace(domain, flows=())
        name = case.name
        if name == "surface":
            name = f"surface, psi = B4' + {domain.chain.first_per_s:.3g} B4"
        results.append(
            BarrierResult(
                name,
                certify(domain, case, errors, largest_boxes),
                domain,
                *(
                    find_counter_example(d, constants, errors, case.name, np.random.default_rng(0))
                    for d in (domain, whole)
                ),
            )
        )
    return Verification(
        preset=preset.name,
        model=model.hash[:8],
        slips=tuple(slip.name for slip in slips),
        held_s=cases[0][0].held_s,
        error_bound_K=constants["estimation_error_bound_K"],
        margins={name: constants[name] for name in MARGINS},
        barriers=tuple(results),
        fallback=infeasible_part(cases[1][0], (decided_core, decided_surface)),
        wall_time_s=time.monotonic() - begin,
    )


def _barrier_dict(result: BarrierResult) -> dict[str, Any]:
    certificate, domain = result.certificate, result.domain
    content: dict[str, Any] = {
        "certified": certificate.holds,
        "boxes": certificate.boxes,
        "open_boxes": certificate.open_boxes,
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
        example = getattr(result, name)
        content[name] = None if example is None else asdict(example)
    return content
