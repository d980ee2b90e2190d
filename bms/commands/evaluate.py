"""`bms evaluate`: errors of a model on data that it was not trained on."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import Enum
from typing import Annotated

import numpy as np
import typer

from bms.arrays import Array, Mask
from bms.commands import options
from bms.data.datasets import simulated_split
from bms.data.measurements import read_measurements
from bms.data.simulate import Samples, joined
from bms.errors import InputError
from bms.firmware import CompiledNetwork
from bms.kan.accuracy import error_figures
from bms.model.model_file import KanModel, load_model
from bms.model.pair import check_pair
from bms.presets import load_preset
from bms.text_table import TextTable


class Engine(str, Enum):
    """What computes the estimate."""

    C = "c"
    PYTHON = "python"


def evaluate(
    model: options.RequiredModelOption,
    data: options.DataOption = None,
    preset: options.SimulatedPresetOption = None,
    engine: Annotated[
        Engine, typer.Option("--engine", help="c is the firmware's float32; python is double.")
    ] = Engine.C,
    as_json: options.JsonOption = False,
) -> None:
    """Print the errors (K) of the estimated core temperature over all samples.

    Extrapolated samples lie out of the trained domain; they are counted and included. With
    --preset the profiles are new ones, neither trained on nor used for the error bound.

    Example: bms evaluate --model model.json --preset paper_calibrated --json
    """
    if (preset is None) == (data is None):
        raise InputError("evaluate: give either --preset NAME or --data CSV")
    loaded = load_model(model)
    if data is not None:
        samples = read_measurements(data).samples(loaded.network.lags)
    else:
        assert preset is not None
        chosen = load_preset(preset)
        check_pair(chosen, loaded, preset)
        seed = loaded.training.settings.seed
        lags = loaded.network.lags
        samples = joined(simulated_split(chosen, "evaluation", seed, lags=lags).values())
    estimate_K, in_domain = _estimate(loaded, samples, engine, is_recording=data is not None)
    figures = error_figures(estimate_K, samples.core_temperature_K)
    result = {**asdict(figures), "extrapolated_samples": int(np.count_nonzero(~in_domain))}
    if as_json:
        typer.echo(json.dumps(result, indent=1))
    else:
        table = TextTable("figure", "value", title=f"{model}, engine {engine.value}")
        for name, value in result.items():
            table.add_row(name, f"{value:.4f}" if isinstance(value, float) else str(value))
        table.print()


def _estimate(
    model: KanModel, samples: Samples, engine: Engine, is_recording: bool
) -> tuple[Array, Mask]:
    if engine is Engine.PYTHON:
        return model.network.evaluate(samples.inputs)
    compiled = CompiledNetwork(model)
    return compiled.follow(samples) if is_recording else compiled.evaluate(samples.inputs)
