"""`bms import-pykan`: a network trained with pykan as a model."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bms.commands import options
from bms.errors import InputError
from bms.kan.network import INPUT_NAMES
from bms.kan.scaling import Scaling
from bms.model.model_file import KanModel, save_model
from bms.presets import DEFAULT_PRESET, Preset, load_preset
from bms.pykan_import import imported_model, imported_network, read_checkpoint, with_all_inputs
from bms.tables import network_tables
from bms.text_table import TextTable
from bms.waiting import waiting


def import_pykan(
    checkpoint: Annotated[
        Path, typer.Argument(help="What saveckpt was given: PATH of PATH_config.yml, PATH_state.")
    ],
    out: options.ModelOutOption,
    preset: Annotated[
        str,
        options.preset_option("Preset for the default scaling (its box) and the test profiles"),
    ] = DEFAULT_PRESET,
    data: options.DataOption = None,
    center: Annotated[
        str | None, typer.Option("--center", help="Middle of each input (A, W, K, K), as a,b,c,d.")
    ] = None,
    half_range: Annotated[
        str | None,
        typer.Option("--half-range", help="Half width of each input, pykan's x = 1 above middle."),
    ] = None,
    input_id: Annotated[
        str | None,
        typer.Option("--input-id", help="pykan's input_id of a network after prune_input: 0,2,3."),
    ] = None,
    output_center_K: Annotated[
        float, typer.Option("--output-center", help="Core temperature (K) at pykan's output 0.")
    ] = 0.0,
    output_half_range_K: Annotated[
        float, typer.Option("--output-half-range", help="Kelvin for each 1 of pykan's output.")
    ] = 1.0,
    as_json: options.JsonOption = False,
) -> None:
    """Import a network that pykan has trained on inputs scaled to -1..1, and test it.

    The four inputs are current, cooling power, surface and coolant temperature; another number of
    inputs is imported without test, for evaluation only. Beyond a grid pykan's splines silently
    become 0; here the last value is kept and the estimate flagged. Edges that were fixed to another
    symbol than 0 are refused. Without --data the errors are those on the preset's test profiles.

    Example: bms import-pykan model/0.1 --out model.json --output-center 300 --output-half-range 20
    """
    chosen = load_preset(preset)
    if not output_half_range_K > 0.0:
        raise InputError("--output-half-range: must be above 0")
    source = with_all_inputs(
        read_checkpoint(checkpoint),
        None if input_id is None else options.number_list("--input-id", input_id, int, "0,2,3"),
    )
    if data is not None and len(source.layers[0].knots) != len(INPUT_NAMES):
        raise InputError(
            f"--data: cannot test {checkpoint}, which has not the four inputs; leave it out"
        )
    default_center, default_half = _box(chosen, len(source.layers[0].knots))
    halves = default_half if half_range is None else _numbers("--half-range", half_range)
    if min(halves) <= 0.0:
        raise InputError(f"--half-range: '{half_range}' must be above 0 for every input")
    scaling = Scaling(
        np.array(default_center if center is None else _numbers("--center", center)),
        np.array(halves),
        output_center_K,
        output_half_range_K,
    )
    network = imported_network(source, scaling)
    with waiting("testing the network") as wait:
        model = imported_model(source, network, chosen, data, wait.reach)
    save_model(model, out)
    result = _result(model)
    if source.samples is not None:
        values = scaling.input_center + scaling.input_half_range * source.samples
        trusted = model.network.evaluate(values)[1]
        result |= {
            "checkpoint_samples": len(trusted),
            "checkpoint_samples_in_domain": int(np.count_nonzero(trusted)),
        }
    if as_json:
        typer.echo(json.dumps(result, indent=1))
    else:
        typer.echo(f"{out}: model {model.hash[:8]}, error bound {model.error_bound_K:.4f} K")
        table = TextTable("figure", "value")
        for name, value in result.items():
            table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
        table.print()


def _box(preset: Preset, inputs: int) -> tuple[list[float], list[float]]:
    """Middles and half widths of the preset's box, or 0 and 1 for other inputs than the four."""
    if inputs != len(INPUT_NAMES):
        return [0.0] * inputs, [1.0] * inputs
    ranges = preset.operating_box.ranges()
    return (
        [0.5 * (low + high) for low, high in ranges],
        [0.5 * (high - low) for low, high in ranges],
    )


def _numbers(option: str, text: str) -> list[float]:
    return options.number_list(option, text, _finite, "-12,1,300,295")


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError
    return value


def _result(model: KanModel) -> dict[str, Any]:
    network = model.network
    result: dict[str, Any] = {"width": list(network.width), "degree": network.degree}
    if "test" in model.errors:
        result |= asdict(model.errors["test"].overall)
    result["error_bound_K"] = model.error_bound_K
    try:
        tables = network_tables(network)
    except InputError as error:
        return result | {"fits_firmware": False, "remark": str(error)}
    return result | {
        "fits_firmware": True,
        "table_cells": tables.cells,
        "table_error_K": tables.error_bound_K,
    }
