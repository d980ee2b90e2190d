"""`bms train`: a model from a preset or from measurements."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from bms.commands import options
from bms.errors import InputError
from bms.kan.network import INPUT_NAMES
from bms.kan.settings import PRESET_LAGS_S, TrainingSettings
from bms.model.make import model_for_measurements, model_for_preset
from bms.model.model_file import KanModel, save_model
from bms.presets import load_preset
from bms.text_table import TextTable
from bms.validation import parse
from bms.waiting import waiting

DEFAULTS = TrainingSettings()
_LIST_EXAMPLE = "4,1,1"
_LAGS_OF_RECORDINGS_S = (10.0, 160.0)


def train(
    out: options.ModelOutOption,
    preset: options.SimulatedPresetOption = None,
    data: options.DataOption = None,
    seed: Annotated[int, options.seed_option("data and training")] = DEFAULTS.seed,
    lagged: Annotated[
        bool,
        typer.Option("--lagged", help="Add low-pass filtered current squared and surface rise."),
    ] = False,
    lag_time_constants_s: Annotated[
        str | None,
        typer.Option(
            "--lag-time-constants",
            help="Of the filters, in s: 3 with --preset, 10,160 with --data; implies --lagged.",
        ),
    ] = None,
    width: Annotated[
        str | None,
        typer.Option("--width", help="Nodes of inputs and layers, such as 4,1,1, the default."),
    ] = None,
    grid: Annotated[int, typer.Option("--grid", help="Grid intervals G.")] = DEFAULTS.grid,
    degree: Annotated[int, typer.Option("--degree", help="Spline degree k.")] = DEFAULTS.degree,
    epochs: Annotated[
        int, typer.Option("--epochs", help="Penalised epochs, of widths other than n,1,1.")
    ] = DEFAULTS.epochs,
    refinement_steps: Annotated[
        int,
        typer.Option(
            "--refinement-steps", help="L-BFGS steps without penalties afterwards, at most."
        ),
    ] = DEFAULTS.refinement_steps,
) -> None:
    """Train the estimator of the core temperature (K) and write it with its errors.

    With --preset the data are simulated constant and dynamic charging profiles, split by whole
    profiles; with --data they are measurements, the first two thirds of them for training.

    A lagged model also sees what has been: low-pass filtered current squared, and how far the
    surface temperature is above its own filtered value. The width n,1,1 is fitted in closed form,
    with --data as smooth as stretches left out allow; epochs are for other widths.

    Example: bms train --preset paper_calibrated --out model.json
    """
    if (preset is None) == (data is None):
        raise InputError("train: give either --preset NAME or --data CSV")
    constants_s: list[float] = []
    if lag_time_constants_s is not None:
        constants_s = options.number_list(
            "--lag-time-constants", lag_time_constants_s, float, _LIST_EXAMPLE
        )
    elif lagged:
        constants_s = list(PRESET_LAGS_S if data is None else _LAGS_OF_RECORDINGS_S)
    inputs = len(INPUT_NAMES) + 2 * len(constants_s)
    nodes = [inputs, 1, 1]
    if width is not None:
        nodes = options.number_list("--width", width, int, _LIST_EXAMPLE)
    settings = _settings(
        seed=seed,
        width=nodes,
        lag_time_constants_s=constants_s,
        grid=grid,
        degree=degree,
        epochs=epochs,
        refinement_steps=refinement_steps,
    )
    _require_writable(out)
    with waiting("training") as wait:
        if data is not None:
            model = model_for_measurements(data, settings, wait.reach)
        else:
            assert preset is not None
            model = model_for_preset(load_preset(preset), settings, wait.reach)
    save_model(model, out)
    typer.echo(f"{out}: model {model.hash[:8]}, error bound {model.error_bound_K:.4f} K")
    _table(model).print()


def _settings(**values: object) -> TrainingSettings:
    return parse(TrainingSettings, values, "train")


def _require_writable(out: Path) -> None:
    """Fail before the training rather than after it."""
    if out.is_dir() or not out.parent.is_dir() or not os.access(out.parent, os.W_OK):
        raise InputError(f"{out}: cannot be written; choose a file in a folder that can")


def _table(model: KanModel) -> TextTable:
    table = TextTable("split", "profiles", "RMSE K", "largest K", "bias K", "samples")
    for split, errors in model.errors.items():
        kinds = {"constant": errors.constant, "dynamic": errors.dynamic, "all": errors.overall}
        for kind, figures in kinds.items():
            if figures is not None:
                table.add_row(
                    split,
                    kind,
                    f"{figures.rmse_K:.4f}",
                    f"{figures.max_abs_error_K:.4f}",
                    f"{figures.bias_K:+.4f}",
                    str(figures.samples),
                )
    return table
