"""Option --baseline of `bms sil`: what is charged beside the controller."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import Annotated

import typer

from bms.errors import InputError
from hil_sim.bus.catalog import Mode
from hil_sim.run.settings import ControllerKind, Settings


class Baseline(str, Enum):
    """Names on the command line: every controller, and the firmware without a plan."""

    KAN_RCBF = "kan-rcbf"
    KAN_RCBF_FIXED = "kan-rcbf-fixed"
    S_CBF = "s-cbf"
    S_CBF_SINGLE_STEP = "s-cbf-single-step"
    CC_CV = "cc-cv"
    MULTI_STAGE = "multi-stage"

    @property
    def controller(self) -> ControllerKind:
        """What controls the charge."""
        if self is Baseline.KAN_RCBF_FIXED:
            return ControllerKind.KAN_RCBF
        return ControllerKind(self.value)


BaselineOption = Annotated[
    list[Baseline] | None,
    typer.Option(
        "--baseline",
        help="Charge with this one too and show it beside the controller; may be repeated. "
        "kan-rcbf-fixed is the firmware that follows the reference current, whatever --mode says.",
    ),
]


def baseline_settings(settings: Settings, baselines: list[Baseline], bus: str) -> list[Settings]:
    """The settings of each baseline: those of the controller's charge, on a bus of its own process.

    Raises InputError for one that is named twice.
    """
    twice = next((one for one in baselines if baselines.count(one) > 1), None)
    if twice is not None:
        raise InputError(f"--baseline {twice.value}: is named twice; leave one out")
    return [_settings(settings, baseline, bus) for baseline in baselines]


def _settings(settings: Settings, baseline: Baseline, bus: str) -> Settings:
    own = replace(settings, controller=baseline.controller, bus=bus)
    if baseline is Baseline.KAN_RCBF_FIXED:
        return replace(own, mode=Mode.FIXED, full_by_s=None)
    return own
