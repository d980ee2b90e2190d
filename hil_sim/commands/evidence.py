"""`bms evidence`: what is recorded of this firmware, for whoever assesses a product built on it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import JsonOption
from hil_sim.evidence.collect import collect
from hil_sim.evidence.page import archive, numbers, page
from hil_sim.report.folder import OutputFolder


def evidence(
    out: Annotated[
        Path,
        typer.Option(
            "--out", file_okay=False, help="Folder for evidence.html, evidence.json, records.zip."
        ),
    ],
    date: Annotated[
        str | None,
        typer.Option(
            "--date", help="Date to put on the page. Default: none, so that bytes repeat."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Collect coverage, mutants, proofs, MISRA, fault matrix, budgets, certificates and campaigns.

    Each record is held to the sources that lie here: it is current, or stale where they have
    changed since it was made. Nothing is measured anew; `make evidence` first runs what is quick.
    Needs a checkout of the repository. Exit code 1 when a piece is stale, missing or incomplete,
    each of them named with its remedy.

    Example: bms evidence --out out/evidence
    """
    collected = collect()
    content = numbers(collected, date)
    with OutputFolder(out) as folder:
        folder.path("evidence.html").write_text(page(collected, date), encoding="utf-8")
        folder.path("evidence.json").write_text(content, encoding="utf-8")
        folder.path("records.zip").write_bytes(archive(collected))
        folder.commit()
    pieces = sum(len(section.items) for section in collected.sections)
    wanting = collected.open_items()
    if as_json:
        typer.echo(content, nl=False)
    else:
        for section, item in wanting:
            typer.echo(f"{item.state}: {section}, {item.name}; {item.remedy}")
        typer.echo(f"{pieces - len(wanting)} of {pieces} pieces of evidence are current")
    return EXIT_CHECK_FAILED if wanting else EXIT_DONE
