"""`python -m bms.studies.paper_fit`: fit the free parameters of a preset to the paper's figures."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bms.errors import BmsError
from bms.files import write_text
from bms.presets import DEFAULT_PRESET, Preset, load_preset, preset_path
from bms.studies.paper_fit.closed_loop import Start
from bms.studies.paper_fit.figures import FIGURES
from bms.studies.paper_fit.fit import (
    FINAL_PERIOD_S,
    FREE_PARAMETERS,
    both_charges,
    figures_of,
    fit,
    rounded_preset,
)
from bms.studies.paper_fit.preset_text import with_values
from bms.text_table import TextTable
from bms.validation import read_text
from bms.waiting import waiting


def run(
    preset: Annotated[
        str,
        typer.Option(
            "--preset",
            help="Preset to begin from: name of a shipped one, or path of a TOML file.",
        ),
    ] = DEFAULT_PRESET,
    out: Annotated[
        Path | None, typer.Option("--out", help="Fitted preset to write (TOML).")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the search.")] = 0,
    generations: Annotated[
        int, typer.Option("--generations", min=0, help="Length of the search; 0 only compares.")
    ] = 150,
    error_bound_K: Annotated[
        float | None,
        typer.Option("--error-bound", min=0.0, help="Error bound of the estimator in K."),
    ] = None,
) -> None:
    """Fit a preset's free parameters to the paper's seven figures and print what is left.

    Example: python -m bms.studies.paper_fit --seed 1 --out fitted.toml
    """
    fitted = load_preset(preset)
    if generations > 0:
        fitted = _search(fitted, error_bound_K, seed, generations)
    _parameter_table(fitted).print()
    _figure_table(fitted, error_bound_K).print()
    if out is not None:
        write_text(out, with_values(read_text(preset_path(preset)), _fitted_values(fitted)))


def _search(preset: Preset, error_bound_K: float | None, seed: int, generations: int) -> Preset:
    with waiting("searching", generations, "generations") as wait:

        def show(generation: int, misfit: float) -> None:
            wait.reach(generation, f"searching, misfit {misfit:.3f}")

        values = fit(preset, error_bound_K, seed, generations, show)
    return rounded_preset(preset, values)


def _fitted_values(preset: Preset) -> dict[tuple[str, str], float]:
    """Every number that the fit sets, by section and key of the preset file."""
    values: dict[tuple[str, str], float] = {}
    for parameter in FREE_PARAMETERS:
        section = "initial" if parameter.name in Start._fields else "cell"
        values[section, parameter.name] = getattr(getattr(preset, section), parameter.name)
    values["cell", "core_heat_capacity_J_per_K"] = preset.cell.core_heat_capacity_J_per_K
    return values


def _parameter_table(preset: Preset) -> TextTable:
    table = TextTable("parameter", "value", "range searched", "source of the range")
    values = {name: value for (_, name), value in _fitted_values(preset).items()}
    for parameter in FREE_PARAMETERS:
        table.add_row(
            parameter.name,
            f"{values[parameter.name]:.5g}",
            f"{parameter.low:g} .. {parameter.high:g}",
            parameter.range_source,
        )
    return table


def _figure_table(preset: Preset, error_bound_K: float | None) -> TextTable:
    initial = preset.initial
    start = Start(initial.soc, initial.temperature_K, initial.cooling_power_W)
    charges = both_charges(preset, preset.cell, start, error_bound_K, FINAL_PERIOD_S)
    table = TextTable("figure", "paper", "ours", "difference", "of tolerance")
    for figure, ours in zip(FIGURES, figures_of(*charges)):
        difference = float(ours) - figure.paper
        table.add_row(
            f"{figure.name}, {figure.unit}",
            f"{figure.paper:.2f}",
            f"{float(ours):.2f}",
            f"{difference:+.2f}",
            f"{abs(difference) / figure.tolerance:.0%}",
        )
    return table


if __name__ == "__main__":
    try:
        typer.run(run)
    except BmsError as error:
        sys.stderr.write(f"paper_fit: {error}\n")
        sys.exit(2)
