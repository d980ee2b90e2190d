"""What `bms verify` does with --cells: the certificate of a pack as a table or JSON."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.model.pair import load_pair
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.pack.settings import PackChargeSettings, spread_of
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.pack.thermistor_map import thermistor_map
from hil_sim.studies.pack.certificate import (
    FAMILY_PARTS,
    PARTS,
    PackCertificate,
    certify_pack,
)
from hil_sim.studies.pack.spread import Surroundings


def verify_pack(
    preset: str,
    model: Path | str | None,
    cells: int,
    spread: SpreadKind,
    per_thermistor: int,
    thermistors: Path | None,
    around: Surroundings,
    as_json: bool,
) -> int:
    """Certify a pack, print what was shown, and return the exit code."""
    chosen, estimator = load_pair(preset, model)
    settings = PackChargeSettings(
        chosen,
        estimator,
        cells,
        spread=spread,
        per_thermistor=per_thermistor,
        around=around,
        thermistor_at=thermistor_map(thermistors, cells, per_thermistor),
    )
    parts = PARTS if chosen.cell.interval is None else FAMILY_PARTS
    with waiting("verifying the pack", parts, "parts") as wait:
        result = certify_pack(
            chosen, estimator, spread_of(spread), around, settings.view, note=wait.begin
        )
    if as_json:
        print(json.dumps(result.as_dict(), indent=1))
    else:
        print_certificate(Console(), result)
    return EXIT_DONE if result.certified else EXIT_CHECK_FAILED


def print_certificate(console: Console, result: PackCertificate) -> None:
    """The claims with bounds and margins, what the margins consist of, and what is not shown."""
    table = TextTable("of each cell", "holds", "bound", "margin", "")
    for claim in result.claims:
        table.add_row(
            claim.name,
            "yes" if claim.holds else "NO",
            f"{claim.bound:.6g}",
            f"{claim.margin:.3g}",
            claim.unit,
        )
    table.print(console)
    for claim in result.claims:
        console.print(f"{claim.name}: {claim.claim}")
        if not claim.holds:
            console.print(f"NOT certified: {claim.name}: {claim.reason}")
    _print_reserves(console, result)
    for text in result.speaks_for:
        console.print(f"speaks for: {text}")
    for text in result.not_proven:
        console.print(f"not proven: {text}")
    verdict = "certified" if result.certified else "NOT certified"
    checked = f", {result.cells_checked} cells checked" if result.cells_checked else ""
    console.print(
        f"{result.cells} cells of {result.preset}, {result.thermistors} thermistors: {verdict}"
        f"{checked}, {result.wall_time_s:.1f} s"
    )


def _print_reserves(console: Console, result: PackCertificate) -> None:
    if not result.core_margin:
        return
    reserves = TextTable("constant", "preset's", "pack's, for all corners")
    for name, values in result.reserves.items():
        reserves.add_row(name, f"{values['preset']:.5g}", f"{values['pack']:.5g}")
    reserves.print(console)
    part = result.core_margin
    console.print(
        f"core margin {part['whole_K_per_s']:.4g} K/s: sampling {part['sampling_K_per_s']:.4g}, "
        f"neighbours {part['neighbours_K_per_s']:.4g}, estimate {part['estimate_K_per_s']:.4g}"
    )
    covered = part["coupling_covered_K_per_s"]
    console.print(
        f"neighbours: {part['coupling_bound_K_per_s']:.4g} K/s at most (the preset assumes "
        f"{part['preset_surface_K_per_s']:.2g} K/s); "
        + (f"the cores are certified up to {covered:.4g} K/s" if covered else "not covered")
    )
