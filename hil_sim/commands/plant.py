"""`bms plant`: cell, sensors and charger on a CAN bus, for an ECU in another process."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from bms.commands.options import JsonOption, ModelOption, PresetOption
from bms.errors import InputError
from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.commands import charge_mode, options, pack_options
from hil_sim.commands.outcome import charge_and_report, charge_settings
from hil_sim.pack.cell_plants import cell_plants
from hil_sim.pack.spread_kind import SpreadKind
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
    cells: pack_options.CellsOption = None,
    spread: pack_options.SpreadOption = SpreadKind.PUBLISHED,
    per_thermistor: pack_options.PerThermistorOption = 1,
    thermistors: pack_options.ThermistorsOption = None,
    cell_plant: pack_options.CellPlantOption = None,
    bleed_ohm: pack_options.BleedOption = 0.0,
    balance_s: pack_options.BalanceOption = 0.0,
    model: ModelOption = None,
) -> int:
    """Charge a simulated cell with whatever ECU is on the bus, for example `bms ecu`.

    Measurements, then SYNC start each control period, and the plant waits for the charge command;
    with --realtime it sends no SYNC and waits for nobody. Temperatures in K, currents in A
    (negative while charging), times in s from the start of the charge. With --cells it is a pack of
    cells that differ, which takes only its own ECU: one of as many cells, of the same preset and
    --model. Exit code 1 when a limit is crossed, or the charge fails or does not end in time.

    Example: bms plant --bus socketcan:vcan0 --seed 1 --out out/run
    """
    if cells is not None:
        from hil_sim.commands import pack_charge  # noqa: PLC0415 (plots and solvers)

        pack_options.refuse_options(
            {
                "--plant": cell != Settings.plant,
                "--disturbance": disturbance is not DisturbanceKind.NONE,
                "--faults": faults is not None,
                "--realtime": realtime,
                "--mode": mode is not None,
                "--full-by-s": full_by_s is not None,
            }
        )
        chosen = pack_charge.pack_settings(
            preset,
            model,
            cells,
            bus,
            spread,
            per_thermistor,
            seed,
            max_time_s,
            answer_timeout_s,
            thermistors,
        )
        chosen = replace(
            chosen,
            bleed_ohm=bleed_ohm,
            balance_s=balance_s,
            cell_plants=cell_plants(cell_plant or [], cells),
        )
        return pack_charge.plant_pack(chosen, out, as_json, log)
    pack_options.refuse_pack_options(spread, per_thermistor, thermistors, cell_plant)
    pack_options.refuse_balancing(bleed_ohm, balance_s)
    if model is not None:
        raise InputError(f"--model {model}: is what a pack's ECU has to have; add --cells")
    settings = charge_settings(
        load_preset(preset), bus, seed, disturbance, faults, max_time_s, realtime, cell
    )
    settings = charge_mode.with_mode(settings, mode, full_by_s)
    settings = replace(settings, answer_timeout_s=answer_timeout_s)
    return charge_and_report(settings, run_plant, out, as_json, log=log)
