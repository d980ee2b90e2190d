"""`bms compare-estimators`: the network beside filters, a perceptron and polynomials."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from bms.commands import options
from bms.data.cooling import Cooling
from bms.data.measurements import recording_sha256
from bms.errors import InputError
from bms.files import make_folder, write_text
from bms.kan.network import INPUT_NAMES
from bms.kan.settings import PRESET_LAGS_S, TrainingSettings
from bms.model.model_file import load_model, load_shipped_model, shipped_model_path
from bms.presets import Preset, load_preset
from bms.studies.rivals.chart import save_chart
from bms.studies.rivals.comparison import KINDS, Comparison, NamedModel, Row, run_comparison
from bms.studies.rivals.effort import FULL, QUICK
from bms.studies.rivals.lagged import all_lags
from bms.studies.rivals.recorded import recorded_problem
from bms.studies.rivals.simulated import simulated_problem
from bms.studies.rivals.trained import trained_on
from bms.studies.rivals.verdict import verdict
from bms.text_table import TextTable
from bms.waiting import waiting

DEFAULT_CELL = "lin2014"


def compare_estimators(
    preset: options.SimulatedPresetOption = None,
    data: options.DataOption = None,
    model: Annotated[
        list[Path] | None,
        options.model_option("Model to compare beside the preset's own", repeated=True),
    ] = None,
    cell: Annotated[
        str | None,
        options.preset_option(
            "With --data, preset whose cell the filters take as it is",
            f"that of {DEFAULT_CELL}, fitted to the first two thirds",
            name="--cell",
        ),
    ] = None,
    profiles: Annotated[
        int | None,
        typer.Option("--profiles", min=1, help="With --preset: profiles of each kind and split."),
    ] = None,
    cooling: Annotated[
        Cooling,
        typer.Option(
            "--cooling",
            help="With --preset, how the plant's surface is cooled; but for linear, networks are "
            "trained on that plant first.",
        ),
    ] = Cooling.LINEAR,
    seed: Annotated[
        int | None, options.seed_option("data and fits", "that of the training")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fit MLP and floor for a moment only: a first look.")
    ] = False,
    out: Annotated[
        Path | None, options.out_folder_option("estimators.json and estimators.png")
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Compare the KAN with its rivals: error (K), size, work and time of an estimate in float32 C.

    The rivals are Kalman filters that know the cell, a perceptron of the KAN's size, linear and
    quadratic maps; the floor is what a large map of the same four inputs reaches. With --preset the
    data are whole profiles that no training has seen, from a plant like the cell model or, by
    --cooling, one that it does not describe; with --data the last third of a recording.

    Example: bms compare-estimators --preset paper_calibrated --out out/estimators
    """
    _require_one_source(preset, data, cell, profiles, cooling, has_models=bool(model))
    chosen = load_preset(preset or cell or DEFAULT_CELL)
    if out is not None:
        make_folder(out)
    models, warnings = [], []
    if cooling is not Cooling.LINEAR:
        models = _trained(chosen, cooling, seed or 0, profiles)
    else:
        models = _models(chosen if data is None else None, model or [])
        warnings = _warnings(models, data, chosen)
    lags = all_lags(network.model.network for network in models)
    of_models = models[0].model.training.settings.seed if models else 0
    used_seed = of_models if seed is None else seed
    with waiting("comparing", 1 + len(models) + KINDS, "parts") as wait:
        if data is not None:
            wait.begin("cell and noise of the recording")
            problem = recorded_problem(data, chosen, cell is None, lags)
        else:
            wait.begin("simulating profiles")
            problem = simulated_problem(chosen, used_seed, lags, profiles, cooling)
        effort = QUICK if quick else FULL
        comparison = run_comparison(
            problem, models, used_seed, time.perf_counter_ns, effort, wait.begin
        )
    sentences = verdict(comparison)
    result = {
        "data": comparison.title,
        "seed": used_seed,
        "quick": quick,
        "estimators": [_content(row) for row in comparison.rows],
        "verdict": sentences,
        "warnings": warnings,
    }
    text = json.dumps(result, indent=1)
    if out is not None:
        write_text(out / "estimators.json", text + "\n")
        save_chart(comparison, out / "estimators.png")
    if as_json:
        typer.echo(text)
    else:
        _print(comparison, quick)
        typer.echo("\n".join(sentences))
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)


def _require_one_source(
    preset: str | None,
    data: Path | None,
    cell: str | None,
    profiles: int | None,
    cooling: Cooling,
    *,
    has_models: bool,
) -> None:
    if (preset is None) == (data is None):
        raise InputError("compare-estimators: give either --preset NAME or --data CSV")
    if preset is None and profiles is not None:
        raise InputError("compare-estimators: --profiles belongs to --preset; leave it out")
    if data is None and cell is not None:
        raise InputError(
            "compare-estimators: --cell belongs to --data; with --preset filters get the true cell"
        )
    is_trained_here = cooling is not Cooling.LINEAR
    if data is not None and is_trained_here:
        raise InputError("compare-estimators: --cooling belongs to --preset; leave it out")
    if has_models and is_trained_here:
        raise InputError(
            f"compare-estimators: --model was trained on another plant than --cooling "
            f"{cooling.value}, for which networks are trained anew; leave one of them out"
        )


def _trained(preset: Preset, cooling: Cooling, seed: int, profiles: int | None) -> list[NamedModel]:
    """A network of the paper's kind and a lagged one."""
    models = []
    for name, lags_s in (("KAN", ()), ("lagged KAN", PRESET_LAGS_S)):
        settings = TrainingSettings(
            width=(len(INPUT_NAMES) + 2 * len(lags_s), 1, 1), seed=seed, lag_time_constants_s=lags_s
        )
        with waiting(f"training the {name}") as wait:
            models.append(
                NamedModel(name, trained_on(preset, cooling, settings, profiles, wait.reach))
            )
    return models


def _models(preset: Preset | None, paths: list[Path]) -> list[NamedModel]:
    """The preset's own network first, then those of the files, which can do without it."""
    models = []
    if preset is not None and (shipped_model_path(preset.name).is_file() or not paths):
        models.append(NamedModel("KAN", load_shipped_model(preset.name)))
    for path in paths:
        loaded = load_model(path)
        if loaded.network.input_names[: len(INPUT_NAMES)] != INPUT_NAMES:
            raise InputError(f"{path}: input_names: must begin with {', '.join(INPUT_NAMES)}")
        kind = "lagged KAN" if loaded.network.lags else "KAN"
        models.append(NamedModel(f"{kind} ({path.stem})", loaded))
    names = [name for name, _ in models]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"--model: two files would both be called {name}; rename one")
    return models


def _warnings(models: list[NamedModel], data: Path | None, preset: Preset) -> list[str]:
    """One line for every network that was trained on something else."""
    if data is None:
        strangers = [name for name, model in models if model.training_hash != preset.training_hash]
        return [
            f"{name} was not trained for preset {preset.name} as it is now; its errors are those "
            "of a network that does not belong to the cell"
            for name in strangers
        ]
    digest = recording_sha256(data)
    warnings = [
        f"{name} was not trained on {data.name} but on {model.training.data}; its errors say "
        "little about the method"
        for name, model in models
        if model.training.data_sha256 != digest
    ]
    if not models:
        warnings.append(
            f"no network in the table; train one with 'bms train --data {data} --lagged "
            "--out model.json' and give it as --model model.json"
        )
    return warnings


def _content(row: Row) -> dict[str, Any]:
    cost = row.cost
    return {
        "name": row.name,
        "given": row.given,
        "errors": {scope: asdict(figures) for scope, figures in row.errors.items()},
        "rmse_with_sensor_errors_K": row.read_rmse_K,
        "parameters": None if cost is None else cost.parameters,
        "bytes": None if cost is None else cost.bytes,
        "multiply_adds": None if cost is None else cost.multiply_adds,
        "time_per_estimate_ns": row.time_per_estimate_ns,
        "remark": row.remark,
    }


def _print(comparison: Comparison, quick: bool) -> None:
    scopes = list(comparison.rows[0].errors)
    counted = comparison.rows[0].counted
    headings = [f"RMSE\n{scope.replace(' ', chr(10))}" for scope in scopes]
    headings.append(f"largest\n{counted.replace(' ', chr(10))}")
    has_read = comparison.rows[0].read_rmse_K is not None
    if has_read:
        headings.append("RMSE\nwith\nsensors")
    headings += ["param-\neters", "bytes", "multi-\nply-\nadds", "time\nns"]
    table = TextTable(
        "estimator",
        *headings,
        title=comparison.title + (", quick fits" if quick else ""),
        caption="errors in K; bytes, multiply-adds and time of one estimate in float32 C",
    )
    for row in comparison.rows:
        if not row.errors:
            table.add_row(row.name, *("" for _ in headings))
            continue
        cost, read_K, time_ns = row.cost, row.read_rmse_K, row.time_per_estimate_ns
        table.add_row(
            row.name,
            *(f"{row.errors[scope].rmse_K:.4f}" for scope in scopes),
            f"{row.errors[counted].max_abs_error_K:.4f}",
            *([] if read_K is None else [f"{read_K:.4f}"]),
            "" if cost is None else str(cost.parameters),
            "" if cost is None else str(cost.bytes),
            "" if cost is None else str(cost.multiply_adds),
            "" if time_ns is None else f"{time_ns:.1f}",
        )
    table.print()
    for row in comparison.rows:
        if row.remark:
            typer.echo(f"{row.name}: {row.remark}")
