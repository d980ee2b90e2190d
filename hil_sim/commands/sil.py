"""`bms sil`: plant and ECU in one process on a CAN bus."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import Annotated

import typer

from bms.commands.options import JsonOption, ModelOption, PresetOption
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.bus.buses import is_serial_line
from hil_sim.commands import charge_mode, options, pack_options
from hil_sim.commands.baselines import BaselineOption, baseline_settings
from hil_sim.commands.outcome import charge_and_report, charge_settings
from hil_sim.pack.cell_plants import cell_plants
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.session import run_sil
from hil_sim.run.settings import ControllerKind, Settings
from hil_sim.targets.catalog import find_board


def sil(
    controller: Annotated[
        ControllerKind,
        typer.Option("--controller", help="kan-rcbf is the C firmware, others Python baselines."),
    ] = ControllerKind.KAN_RCBF,
    baseline: BaselineOption = None,
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    bus: options.BusOption = Settings.bus,
    target: Annotated[
        str | None,
        typer.Option(
            "--target",
            help="Start the image of 'make firmware' on this board, and take its line as the bus: "
            "qemu:mps2-an386 or qemu:mps2-an385.",
        ),
    ] = None,
    seed: options.SeedOption = 0,
    plant: options.PlantOption = Settings.plant,
    disturbance: options.DisturbanceOption = DisturbanceKind.NONE,
    faults: options.FaultsOption = None,
    out: options.OutOption = None,
    log: options.LogOption = None,
    as_json: JsonOption = False,
    realtime: options.RealtimeOption = False,
    max_time_s: options.MaxTimeOption = 3600.0,
    mode: charge_mode.ModeOption = None,
    full_by_s: charge_mode.FullByOption = None,
    cells: pack_options.CellsOption = None,
    spread: pack_options.SpreadOption = SpreadKind.PUBLISHED,
    per_thermistor: pack_options.PerThermistorOption = 1,
    thermistors: pack_options.ThermistorsOption = None,
    cell_plant: pack_options.CellPlantOption = None,
    bleed_ohm: pack_options.BleedOption = 0.0,
    balance_s: pack_options.BalanceOption = 0.0,
) -> int:
    """Charge a simulated cell over a CAN bus with the ECU in the same process.

    On a bus slcan:socket://... the ECU is the one at the other end of that line, such as an image
    in QEMU: nothing of it runs here, and it has to name the given preset and model.
    Temperatures in K, currents in A (negative while charging), times in s from the start of the
    charge. The S-CBF baselines know the true state of the cell, as their method assumes; all others
    see the bus only. With --cells it is a pack of cells that differ, under the ECU of a pack, and
    the report has a heat map of its cells. Exit code 1 when the controller lets a limit be crossed,
    or the charge fails or does not end in time.

    Example: bms sil --mode fastest --baseline s-cbf --baseline kan-rcbf-fixed --out out/run
    """
    if cells is not None:
        from hil_sim.commands import pack_charge  # noqa: PLC0415 (plots and solvers)

        pack_options.refuse_options(
            {
                "--controller": controller is not ControllerKind.KAN_RCBF,
                "--baseline": bool(baseline),
                "--target": target is not None,
                "--plant": plant != Settings.plant,
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
            thermistors=thermistors,
        )
        chosen = replace(
            chosen,
            bleed_ohm=bleed_ohm,
            balance_s=balance_s,
            cell_plants=cell_plants(cell_plant or [], cells),
        )
        return pack_charge.sil_pack(chosen, out, as_json, log)
    pack_options.refuse_pack_options(spread, per_thermistor, thermistors, cell_plant)
    pack_options.refuse_balancing(bleed_ohm, balance_s)
    with ExitStack() as stack:
        if target is not None:
            if bus != Settings.bus:
                raise InputError(f"--bus {bus}: --target brings a bus of its own; give one of both")
            bus = stack.enter_context(find_board(target).start()).bus
        baselines = baseline or []
        has_firmware = ControllerKind.KAN_RCBF in (
            controller,
            *(one.controller for one in baselines),
        )
        is_remote = is_serial_line(bus)
        if is_remote and controller is not ControllerKind.KAN_RCBF:
            raise InputError(
                f"--controller {controller.value}: on '{bus}' the ECU at the other end controls; "
                "leave it out, or name it as --baseline"
            )
        if model is not None and not has_firmware:
            raise InputError(
                f"--model {model}: only {ControllerKind.KAN_RCBF.value} has an estimator; "
                "leave it out or choose that controller"
            )
        # Of an ECU elsewhere, preset and model are not a choice but what it has to have.
        cell, expected = load_pair(preset, model) if is_remote else (load_preset(preset), model)
        if has_firmware and not is_remote:
            load_pair(preset, model)  # refused here, where the preset's file is known
        settings = replace(
            charge_settings(cell, bus, seed, disturbance, faults, max_time_s, realtime, plant),
            controller=controller,
            model=expected,
        )
        settings = charge_mode.with_mode(settings, mode, full_by_s)
        own_bus = Settings.bus if is_remote else bus
        beside = baseline_settings(settings, baselines, own_bus)
        return charge_and_report(settings, run_sil, out, as_json, beside, log)
