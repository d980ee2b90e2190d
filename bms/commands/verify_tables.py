"""`bms verify-tables`: every argument through every edge of the firmware."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands import options
from bms.errors import InputError
from bms.model.model_file import KanModel, load_model, shipped_models
from bms.text_table import TextTable
from bms.verification.exhaustive import EdgeCheck, check_network
from bms.waiting import waiting

_STRIDE = 8191


def verify_tables(
    model: Annotated[
        list[Path] | None,
        options.model_option("Model to check", "all shipped ones", repeated=True),
    ] = None,
    stride: Annotated[
        int,
        typer.Option("--stride", min=1, help="Try each n-th argument; 1 tries all 2^32 of them."),
    ] = _STRIDE,
    processes: Annotated[int, options.processes_option("--processes")] = options.DEFAULT_PROCESSES,
    as_json: options.JsonOption = False,
) -> int:
    """Hold the firmware's edge functions in C against the double-precision ones.

    An edge is a function of one float32, so all arguments can be tried: with --stride 1 each of the
    2^32 bit patterns, else a part of them, special values and the neighbours of all knots. Exit
    code 1 when an error exceeds the bound that the model states or a domain flag is wrong.

    Example: bms verify-tables --model model.json --stride 1
    """
    paths = list(model) if model else shipped_models()
    models = {str(path): _bounded(load_model(path), path) for path in paths}
    rows: list[dict[str, Any]] = []
    with waiting("trying arguments", len(models)) as wait:
        for name, loaded in models.items():
            checks: list[EdgeCheck] = check_network(loaded.network, stride, processes, wait.advance)
            rows += [_row(name, loaded, check) for check in checks]
    holds = all(row["holds"] for row in rows)
    if as_json:
        typer.echo(json.dumps({"stride": stride, "holds": holds, "edges": rows}, indent=1))
    else:
        _print(rows, stride, holds)
    return EXIT_DONE if holds else EXIT_CHECK_FAILED


def _bounded(model: KanModel, path: Path) -> KanModel:
    if not model.edge_error_bounds:
        raise InputError(
            f"{path}: states no bounds of its edges, because the firmware cannot hold it; "
            "train a smaller network"
        )
    return model


def _row(name: str, model: KanModel, check: EdgeCheck) -> dict[str, Any]:
    bound = model.edge_error_bounds[check.edge]
    return {
        "model": name,
        "model_hash": model.hash,
        "edge": check.edge,
        "arguments": check.arguments,
        "worst_error": check.worst_error,
        "worst_argument": check.worst_argument,
        "error_bound": bound,
        "wrong_flags": check.wrong_flags,
        "wrong_flag_argument": check.wrong_flag_argument,
        "holds": check.worst_error <= bound and check.wrong_flags == 0,
    }


def _print(rows: list[dict[str, Any]], stride: int, holds: bool) -> None:
    table = TextTable(
        "model", "edge", "arguments", "worst error", "at argument", "stated bound", "wrong flags"
    )
    for row in rows:
        table.add_row(
            Path(row["model"]).stem,
            str(row["edge"]),
            str(row["arguments"]),
            f"{row['worst_error']:.3e}",
            f"{row['worst_argument']:.9g}",
            f"{row['error_bound']:.3e}",
            str(row["wrong_flags"]),
        )
    table.print()
    what = "all 2^32 arguments" if stride == 1 else f"every {stride}th argument and the special"
    verdict = "hold" if holds else "do NOT hold"
    typer.echo(f"stated bounds {verdict} for {what}; errors in units of the edge's value")
