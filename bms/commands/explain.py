"""`bms explain`: what a model has learned."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from bms.arrays import Array
from bms.commands import options
from bms.data.datasets import simulated_split
from bms.data.measurements import read_measurements
from bms.data.simulate import joined
from bms.errors import InputError
from bms.files import make_folder, png, write_bytes, write_text
from bms.kan.network import INPUT_NAMES
from bms.model.model_file import KanModel, load_model
from bms.presets import load_preset
from bms.studies.explanation import explain as explained
from bms.studies.explanation.plots import layer_figure, sensitivity_figure
from bms.studies.explanation.report import Subject, as_latex, as_text
from bms.studies.explanation.report import as_json as as_content
from bms.text_table import TextTable
from bms.waiting import waiting

_PROFILES = 30
_UNIFORM_POINTS = 20000
_DPI = 110


def explain(
    model: options.RequiredModelOption,
    out: Annotated[
        Path, options.out_folder_option("plots, formulas and explanation.json", default=None)
    ],
    data: options.DataOption = None,
    preset: Annotated[
        str | None,
        options.preset_option("Preset to simulate the data from", "the one of the model"),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Show the edge functions of a model, formulas for them, and its sensitivities.

    Each edge is plotted in physical units (A, W, K) over the density of the data that reach it, and
    approximated by the best of a library of elementary functions, as text and as LaTeX. The data
    are profiles simulated from the model's preset unless --preset or --data says otherwise.

    Example: bms explain --model model.json --out out/explain
    """
    loaded = load_model(model)
    inputs, source = _inputs(loaded, data, preset)
    with waiting("approximating the edges") as wait:
        result = explained(loaded.network, inputs, wait.reach)
    subject = Subject(model.name, loaded.hash, loaded.network.input_names, source)
    content = json.dumps(as_content(subject, result), indent=1)
    figures = {
        f"edges_layer{number + 1}.png": layer_figure(result, number, subject.input_names)
        for number in range(len(loaded.network.layers))
    }
    figures["sensitivity.png"] = sensitivity_figure(result)
    pictures = {name: png(figure, _DPI) for name, figure in figures.items()}
    make_folder(out)
    for name, picture in pictures.items():
        write_bytes(out / name, picture)
    write_text(out / "explanation.txt", as_text(subject, result))
    write_text(out / "explanation.tex", as_latex(subject, result))
    write_text(out / "explanation.json", content + "\n")
    if as_json:
        typer.echo(content)
        return
    table = TextTable("edge", "form", "RMSE K", "largest K", "R2")
    for layer in result.edges:
        for edge in (edge for row in layer for edge in row):
            table.add_row(
                f"layer {edge.layer}, {edge.source} -> {edge.target}",
                edge.approximation.form,
                f"{edge.rmse_K:.5f}",
                f"{edge.max_abs_error_K:.5f}",
                f"{edge.r_squared:.6f}",
            )
    table.print()
    for symbol, expression in result.formula.steps:
        typer.echo(f"{symbol} = {expression}")
    typer.echo(
        f"formula against the network: RMSE {result.formula_rmse_K:.5f} K, "
        f"largest {result.formula_max_abs_error_K:.5f} K; files in {out}"
    )


def _inputs(model: KanModel, data: Path | None, preset: str | None) -> tuple[Array, str]:
    """Inputs (N, n_in) to explain the model by, and where they come from."""
    network = model.network
    if data is not None and preset is not None:
        raise InputError("explain: give --preset NAME or --data CSV, not both")
    if network.input_names[: len(INPUT_NAMES)] != INPUT_NAMES:
        if data is not None or preset is not None:
            raise InputError(f"{model.hash[:8]}: has other inputs than the cell's; give no data")
        points = np.random.default_rng(0).uniform(
            -1.0, 1.0, (_UNIFORM_POINTS, len(network.input_names))
        )
        center, half = np.array(network.input_center), np.array(network.input_half_range)
        return center + half * points, "uniform over the box"
    if data is not None:
        recording = read_measurements(data, core_may_be_copied=True)
        return recording.samples(network.lags).inputs, data.name
    name = preset or model.preset
    if name is None:
        raise InputError(
            "explain: the model was trained on measurements; give them with --data CSV"
        )
    seed = model.training.settings.seed
    kinds = simulated_split(load_preset(name), "training", seed, _PROFILES, network.lags)
    return joined(kinds.values()).inputs, f"profiles simulated from preset {name}"
