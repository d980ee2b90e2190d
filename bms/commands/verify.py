"""`bms verify` of one cell: a machine-checked argument that decisions keep the barriers."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands import options
from bms.commands.family_tables import print_family
from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET, Preset
from bms.presets.paper_form import in_paper_form
from bms.text_table import TextTable
from bms.verification import (
    CLASHING_DELTA4,
    ESTIMATE,
    LARGEST_BOXES,
    PARTS,
    SLIPS,
    Formulas,
    Verification,
    slips_of,
)
from bms.verification import verify as certify
from bms.verification.closed_loop import HORIZON_S, SlipCost, slip_cost
from bms.verification.family import FAMILY_PARTS, verify_family
from bms.verification.findings import Finding
from bms.verification.search import CounterExample
from bms.waiting import waiting

FormulasOption = Annotated[
    Formulas, typer.Option("--formulas", help="paper: with the slips of the printed formulas.")
]
SlipsOption = Annotated[
    bool, typer.Option("--slips", help="Also charge with each slip and show what it costs.")
]
BoxesOption = Annotated[
    int, typer.Option("--boxes", min=1, help="Boxes after which a barrier is given up.")
]


def verify(
    preset: options.PresetOption = DEFAULT_PRESET,
    model: options.ModelOption = None,
    formulas: FormulasOption = Formulas.CORRECTED,
    slips: SlipsOption = False,
    boxes: BoxesOption = LARGEST_BOXES,
    as_json: options.JsonOption = False,
) -> int:
    """What `bms verify` does for one cell; the exit code."""
    pair = load_pair(preset, model)
    if pair[0].cell.interval is not None:
        if slips or formulas is not Formulas.CORRECTED:
            raise InputError(
                f"--preset {preset}: the paper's formulas know no family of cells; leave out "
                "--slips and --formulas, or take a preset without cell.interval"
            )
        return _verify_family(*pair, as_json)
    if slips or formulas is not Formulas.CORRECTED:
        pair = (_of_the_paper(pair[0]), pair[1])
    costs = []
    shown = ((), *((slip,) for slip in (*SLIPS, CLASHING_DELTA4)), SLIPS) if slips else ()
    with waiting("verifying", (1 + len(shown)) * PARTS + len(shown), "parts") as wait:
        result = certify(*pair, slips_of(formulas), boxes, note=wait.begin)
        for chosen in shown:
            certified = certify(*pair, chosen, boxes, note=wait.begin).certified
            wait.begin("what slips cost in a charge")
            costs.append(slip_cost(*pair, chosen, certified))
    if as_json:
        content = result.as_dict()
        if costs:
            content["slips"] = [asdict(cost) for cost in costs]
        typer.echo(json.dumps(content, indent=1))
    else:
        _print(result)
        if costs:
            _print_costs(costs)
    return EXIT_DONE if result.certified else EXIT_CHECK_FAILED


def _of_the_paper(preset: Preset) -> Preset:
    """The preset with a surface condition that the paper's slips can be in."""
    return preset if preset.gains.surface_condition == "paper" else in_paper_form(preset)


def _verify_family(preset: Preset, model: KanModel, as_json: bool) -> int:
    with waiting("verifying the family", FAMILY_PARTS, "parts") as wait:
        result = verify_family(preset, model, note=wait.begin)
    if as_json:
        typer.echo(json.dumps(result.as_dict(), indent=1))
    else:
        print_family(result)
    return EXIT_DONE if result.certified else EXIT_CHECK_FAILED


def _print(result: Verification) -> None:
    console = Console()
    table = TextTable("barrier", "certified", "boxes", "open", "counter-example")
    for barrier in result.barriers:
        certificate = barrier.certificate
        table.add_row(
            barrier.name,
            "yes" if certificate.holds else "no",
            str(certificate.boxes),
            str(certificate.open_boxes),
            _example(barrier.counter_example),
        )
    table.print(console)
    for barrier in result.barriers:
        if barrier.domain is not None:
            domain = barrier.domain
            core_low, core_high = domain.core_gap_K
            coolant_low, coolant_high = domain.coolant_gap_K
            console.print(
                f"{barrier.name}: domain Ts {domain.low.surface_K:g}..{domain.high.surface_K:g} K, "
                f"Tc - Ts {core_low:.3f}..{core_high:.3f} K, Ts - Tinf {coolant_low:.3f}.."
                f"{coolant_high:.3f} K, condition falls by at most {domain.flows[0].largest:.4g}/s"
            )
        low, high = barrier.certificate.open_low, barrier.certificate.open_high
        if low is not None and high is not None:
            sides = zip(low._fields, low, high)
            console.print(
                f"{barrier.name}: not shown for "
                + ", ".join(f"{name} {a:.3f}..{b:.3f}" for name, a, b in sides)
            )
        if barrier.certificate.by_history:
            console.print(
                f"{barrier.name}: the hold is long for this cell, so that the fall within it is "
                "bounded by that of any history from rest"
            )
        if barrier.outside is not None:
            console.print(f"{barrier.name}: beyond its domain {_example(barrier.outside)}")
        if barrier.name in result.refusals:
            console.print(
                f"{barrier.name}: NOT certified: {_finding(result.refusals[barrier.name])}"
            )
    if ESTIMATE in result.refusals:
        console.print(f"{ESTIMATE}: NOT usable: {_finding(result.refusals[ESTIMATE])}")
    margins = ", ".join(f"{name} {value:.4g}" for name, value in result.margins.items())
    console.print(f"margins: {margins}; error bound {result.error_bound_K:.4f} K")
    part = result.fallback
    worst = ", ".join(
        f"{o.surface_K * 1e3:.2f} mK surface and {o.core_K * 1e3:.2f} mK core after {o.time_s:g} s"
        for o in part.overshoots
    )
    console.print(
        f"no current is safe within {part.core_band_K:.3f} K (core) or {part.surface_band_K:.3f} K "
        f"(surface) below the limit at uniform temperature; 0 A from any safe state exceeds by at "
        f"most {worst}; {part.best_current_A:.2f} A would heat the core "
        f"{part.best_gain_K_per_s:.1e} K/s less"
    )
    for obstacle in result.obstacles:
        console.print(f"charge: {_finding(obstacle)}")
    verdict = "certified" if result.certified else "NOT certified"
    formulas = ", ".join(result.slips) or "corrected"
    console.print(
        f"{result.preset} ({formulas}): {verdict} for {result.held_s:g} s from each reading, "
        f"{result.wall_time_s:.1f} s"
    )


def _finding(finding: Finding) -> str:
    state = ", ".join(f"{name} {value:.6g}" for name, value in finding.state.items())
    return f"{finding.reason} (at {state}); {finding.change}"


def _print_costs(costs: list[SlipCost]) -> None:
    table = TextTable(
        "slip", "certified", "core excess K", "surface excess K", "voltage excess V",
        "charge s", "core peak K", "surface peak K",
    )  # fmt: skip
    for cost in costs:
        time_s = cost.charge_time_s
        table.add_row(
            cost.slip,
            "yes" if cost.certified else "no",
            f"{cost.core_excess_K:+.5f}",
            f"{cost.surface_excess_K:+.5f}",
            f"{cost.voltage_excess_V:+.5f}",
            f"{time_s:.1f}" if time_s is not None else f"soc {cost.soc:.2f} in {HORIZON_S:g} s",
            f"{cost.core_peak_K:.3f}",
            f"{cost.surface_peak_K:.3f}",
        )
    table.print()


def _example(example: CounterExample | None) -> str:
    if example is None:
        return ""
    return (
        f"Tc {example.core_temperature_K:.4f} K, Ts {example.surface_temperature_K:.4f} K, Tinf "
        f"{example.coolant_temperature_K:.4f} K, soc {example.soc:.3f}, {example.current_A:.3f} A: "
        f"barrier {example.value:.2e} within {example.hold_s:g} s"
    )
