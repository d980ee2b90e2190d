"""How a charge is to be made: options of the charging commands and what they say of a run."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import Annotated

import typer

from bms.errors import InputError
from hil_sim.bus.catalog import Mode
from hil_sim.run.settings import ControllerKind, Settings


class ChargeMode(str, Enum):
    """Names on the command line of the modes that a charger can ask for."""

    FIXED = "fixed"
    FASTEST = "fastest"
    BY_TIME = "by-time"


ModeOption = Annotated[
    ChargeMode | None,
    typer.Option(
        "--mode",
        help="What the charger asks for beside the reference current: to follow it, the fastest "
        "charge, or one that is full by --full-by-s. Default: nothing, which is the fastest.",
    ),
]
FullByOption = Annotated[
    float | None,
    typer.Option(
        "--full-by-s", min=1.0, max=65533.0, help="When to be full, in s from the charge's start."
    ),
]


def with_mode(settings: Settings, mode: ChargeMode | None, full_by_s: float | None) -> Settings:
    """The settings of a charge in a mode.

    Raises InputError for a time without the mode that keeps it or the reverse, and for a controller
    that has no modes.
    """
    if mode is ChargeMode.BY_TIME and full_by_s is None:
        raise InputError(f"--mode {mode.value}: needs the time; add --full-by-s")
    if full_by_s is not None and mode is not ChargeMode.BY_TIME:
        raise InputError(
            f"--full-by-s {full_by_s:g}: only mode {ChargeMode.BY_TIME.value} keeps a time; "
            f"add --mode {ChargeMode.BY_TIME.value}"
        )
    if mode is not None and settings.controller is not ControllerKind.KAN_RCBF:
        raise InputError(
            f"--mode {mode.value}: {settings.controller.value} has no modes; leave it out, or "
            f"choose {ControllerKind.KAN_RCBF.value}"
        )
    return replace(settings, mode=None if mode is None else Mode[mode.name], full_by_s=full_by_s)
