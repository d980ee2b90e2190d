"""`bms ecu`: the C firmware on a CAN bus, for a plant in another process."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Annotated

import typer

from bms.commands.options import ModelOption, PresetOption
from bms.firmware import Ecu
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.buses import open_bus, require_shared
from hil_sim.bus.foreign import counts_text
from hil_sim.commands import options, pack_options
from hil_sim.commands.stopping import stop_event
from hil_sim.nodes.clock import WallClock
from hil_sim.nodes.ecu import EcuNode
from hil_sim.nodes.punctuality import Slots, TimeStatistics
from hil_sim.pack.spread_kind import SpreadKind


def ecu(
    bus: options.SharedBusOption,
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    realtime: Annotated[
        bool,
        typer.Option("--realtime", help="Step by the wall clock instead of on SYNC frames."),
    ] = False,
    silence_s: Annotated[
        float,
        typer.Option("--silence-s", min=0.1, help="End after this time in s without a frame."),
    ] = 5.0,
    cells: pack_options.CellsOption = None,
    spread: pack_options.SpreadOption = SpreadKind.PUBLISHED,
    per_thermistor: pack_options.PerThermistorOption = 1,
    thermistors: pack_options.ThermistorsOption = None,
    bleed_ohm: pack_options.BleedOption = 0.0,
) -> int:
    """Run the firmware on a CAN bus until the bus falls silent, or until Ctrl-C or SIGTERM.

    Waits for the first frame as long as it takes. With --cells it is the ECU of a pack, which has
    what cells that differ by --spread need in reserve; with --bleed-ohm it balances them.

    Example: bms ecu --bus socketcan:vcan0 --silence-s 10
    """
    if cells is not None:
        from hil_sim.commands import pack_charge  # noqa: PLC0415 (plots and solvers)

        pack_options.refuse_options({"--realtime": realtime})
        chosen = pack_charge.pack_settings(
            preset, model, cells, bus, spread, per_thermistor, thermistors=thermistors
        )
        return pack_charge.ecu_pack(replace(chosen, bleed_ohm=bleed_ohm), silence_s)
    pack_options.refuse_pack_options(spread, per_thermistor, thermistors)
    pack_options.refuse_balancing(bleed_ohm)
    require_shared(bus)
    firmware = Ecu(preset=preset, model=model)
    stop = stop_event()
    with open_bus(bus) as connection:
        if sys.stderr.isatty():
            print(f"ECU on {bus}; Ctrl-C ends it", file=sys.stderr)
        node = EcuNode(connection, firmware)
        if realtime:
            period_s = firmware.preset.timing.sampling_period_s
            node.run_on_clock(period_s, WallClock(), silence_s, stop.is_set)
        else:
            node.run(silence_s, stop.is_set)
    others = f"; foreign: {counts_text(connection.foreign)}" if connection.foreign else ""
    print(f"ECU on {bus}: {node.frames} frames received, {node.steps} steps{others}")
    if node.slots is not None and node.slots.late_s:
        print(_punctuality(node.slots))
    return 0


def _punctuality(slots: Slots) -> str:
    stall_ms, deadline_ms = 1000.0 * slots.longest_stall_s, 1000.0 * slots.deadline_s
    return (
        f"steps began late by: {TimeStatistics.of(slots.late_s)}\n"
        f"deadlines missed: {slots.missed} (allowed: {deadline_ms:g} ms), "
        f"steps left out: {slots.skipped}, longest stall: {stall_ms:.2f} ms"
    )
