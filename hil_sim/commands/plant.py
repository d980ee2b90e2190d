"""`bms plant`: cell, sensors and charger on a CAN bus, for an ECU in another process."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from bms.commands.options import JsonOption, PresetOption
from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.commands import charge_mode, options
from hil_sim.commands.outcome import charge_and_report, charge_settings
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.session import run_plant
from hil_sim.run.settings import Settings


def plant(
    bus: options.SharedBusOption,
    preset: PresetOption = DEFAULT_PRESET,
    seed: options.SeedOption = 0,
    cell: options.PlantOption = Settings.plant,
    disturbance: options.DisturbanceOption = DisturbanceKind.NONE,
    faults: options.FaultsOption = None,
    out: options.OutOption = None,
    log: options.LogOption = None,
    as_json: JsonOption = False,
    realtime: options.RealtimeOption = False,
    max_time_s: options.MaxTimeOption = 3600.0,
    answer_timeout_s: Annotated[
        float,
        typer.Option(
            "--answer-timeout-s", min=0.01, help="Wait for the ECU in s before it counts as silent."
        ),
    ] = 1.0,
    mode: charge_mode.ModeOption = None,
    full_by_s: charge_mode.FullByOption = None,
) -> int:
    """Charge a simulated cell with whatever ECU is on the bus, for example `bms ecu`.

    Measurements, then SYNC start each control period, and the plant waits for the charge command;
    with --realtime it sends no SYNC and waits for nobody. Temperatures in K, currents in A
    (negative while charging), times in s from the start of the charge. Exit code 1 when a limit is
    crossed, or the charge fails or does not end in time.

    Example: bms plant --bus socketcan:vcan0 --seed 1 --out out/run
    """
    settings = charge_settings(
        load_preset(preset), bus, seed, disturbance, faults, max_time_s, realtime, cell
    )
    settings = charge_mode.with_mode(settings, mode, full_by_s)
    settings = replace(settings, answer_timeout_s=answer_timeout_s)
    return charge_and_report(settings, run_plant, out, as_json, log=log)
