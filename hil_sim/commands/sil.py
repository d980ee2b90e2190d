"""`bms sil`: plant and ECU in one process on a CAN bus."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from bms.errors import InputError
from bms.presets import load_preset
from hil_sim.commands import options
from hil_sim.commands.outcome import charge_and_report
from hil_sim.disturbances import DisturbanceKind
from hil_sim.faults import load_faults
from hil_sim.session import ControllerKind, Settings, run_both


def sil(
    controller: Annotated[
        ControllerKind,
        typer.Option("--controller", help="kan-rcbf is the C firmware, others Python baselines."),
    ] = ControllerKind.KAN_RCBF,
    baseline: Annotated[
        ControllerKind | None,
        typer.Option("--baseline", help="Run this one too and show it beside the controller."),
    ] = None,
    preset: options.PresetOption = options.DEFAULT_PRESET,
    model: options.ModelOption = None,
    bus: options.BusOption = "virtual:bms",
    seed: options.SeedOption = 0,
    disturbance: options.DisturbanceOption = DisturbanceKind.NONE,
    faults: options.FaultsOption = None,
    out: options.OutOption = None,
    log: options.LogOption = None,
    json: options.JsonOption = False,
    realtime: options.RealtimeOption = False,
    max_time_s: options.MaxTimeOption = 3600.0,
) -> int:
    """Charge a simulated cell over a CAN bus with the ECU in the same process.

    Temperatures in K, currents in A (negative while charging), times in s from the start of the
    charge. The S-CBF baselines know the true state of the cell, as their method assumes; all others
    see the bus only. Exit code 1 when the controller lets a limit be crossed or the charge fails.

    Example: bms sil --baseline s-cbf --disturbance bang-bang --out out/run
    """
    if model is not None and ControllerKind.KAN_RCBF not in (controller, baseline):
        raise InputError(
            f"--model {model}: only {ControllerKind.KAN_RCBF.value} has an estimator; "
            "leave it out or choose that controller"
        )
    settings = Settings(
        preset=load_preset(preset),
        controller=controller,
        model=model,
        bus=bus,
        seed=seed,
        disturbance=disturbance,
        faults=() if faults is None else load_faults(faults),
        max_time_s=max_time_s,
        realtime=realtime,
    )
    second = None if baseline is None else replace(settings, controller=baseline)
    return charge_and_report(settings, run_both, out, json, second, log)
