"""Options that several commands share: one name, one meaning, one help text, one reading.

What means the same in every command is an annotated type. What has a role of its own in a command
is a function that takes this role and says the rest as everywhere.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from bms.errors import InputError

N = TypeVar("N", int, float)

DEFAULT_PROCESSES = os.cpu_count() or 1


def preset_option(role: str, default: str | None = None, name: str = "--preset") -> Any:
    """Option for a preset; `default` says what is taken without it, where typer cannot show it."""
    return typer.Option(
        name, help=f"{role}: name of a shipped one, or path of a TOML file.{_said(default)}"
    )


def model_option(role: str, default: str | None = None, *, repeated: bool = False) -> Any:
    """Option --model for a model file; `repeated` where the parameter is a list of them."""
    repetition = " May be repeated." if repeated else ""
    return typer.Option("--model", help=f"{role} (JSON).{repetition}{_said(default)}")


def seed_option(of: str, default: str | None = None) -> Any:
    """Option --seed, an integer from 0."""
    return typer.Option("--seed", min=0, help=f"Seed of {of}.{_said(default)}")


def out_folder_option(contents: str, default: str | None = "nothing is written") -> Any:
    """Option --out for a folder; `default` is None where the option is required."""
    return typer.Option("--out", help=f"Folder for {contents}.{_said(default)}")


def processes_option(name: str) -> Any:
    """Option for a number of processes, whose default is DEFAULT_PROCESSES."""
    return typer.Option(
        name, min=1, show_default=False, help="Processes on this machine. Default: one a core."
    )


def number_list(option: str, text: str, number: Callable[[str], N], example: str) -> list[N]:
    """Numbers of a value such as 4,1,1; InputError when `number` raises ValueError for one."""
    try:
        return [number(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: '{text}' is not a list of numbers such as {example}") from None


def _said(default: str | None) -> str:
    return "" if default is None else f" Default: {default}."


PresetOption = Annotated[str, preset_option("Preset")]
SimulatedPresetOption = Annotated[str | None, preset_option("Preset to simulate the data from")]
ModelOption = Annotated[Path | None, model_option("Model of the estimator", "the preset's own")]
RequiredModelOption = Annotated[Path, model_option("Model of the estimator")]
ModelOutOption = Annotated[Path, typer.Option("--out", help="Model to write (JSON).")]
DATA_HELP = (
    "CSV with the columns time_s, current_A (negative while charging), cooling_power_W, "
    "surface_temperature_K, coolant_temperature_K, core_temperature_K; others are ignored."
)
DataOption = Annotated[Path | None, typer.Option("--data", help=DATA_HELP)]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON and nothing else.")
]
