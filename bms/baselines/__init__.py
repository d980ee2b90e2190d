"""Charging policies to compare with, behind the controller interface of the firmware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from bms.baselines.cc_cv import CcCvController
from bms.baselines.multi_stage import MultiStageController
from bms.baselines.s_cbf import SurfaceBarrierController
from bms.baselines.s_cbf_single_step import SingleStepSurfaceBarrierController
from bms.decision import Controller
from bms.presets import Preset


class Baseline(NamedTuple):
    """How to make a controller for one charge, and whether its method assumes the true state."""

    make: Callable[[Preset], Controller]
    knows_true_state: bool


BASELINES: Mapping[str, Baseline] = MappingProxyType(
    {
        SurfaceBarrierController.name: Baseline(SurfaceBarrierController, True),
        SingleStepSurfaceBarrierController.name: Baseline(SingleStepSurfaceBarrierController, True),
        CcCvController.name: Baseline(CcCvController, False),
        MultiStageController.name: Baseline(MultiStageController, False),
    }
)
"""Every baseline by its name on the command line."""

__all__ = [
    "BASELINES",
    "Baseline",
    "CcCvController",
    "MultiStageController",
    "SingleStepSurfaceBarrierController",
    "SurfaceBarrierController",
]
