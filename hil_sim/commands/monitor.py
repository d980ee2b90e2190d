"""`bms monitor`: a live screen of a running system, from what is on its bus."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from threading import Thread
from typing import Annotated

import typer
from rich.console import Console, RenderableType
from rich.live import Live

from bms.commands.options import preset_option
from bms.image import shipped_contents
from codegen.pack_database import MOST_CELLS
from hil_sim.bus.buses import require_shared
from hil_sim.commands import options
from hil_sim.commands.stopping import stop_event
from hil_sim.monitor.keyboard import Keyboard
from hil_sim.monitor.listener import Listener
from hil_sim.monitor.model import Snapshot
from hil_sim.monitor.pack_model import PackSnapshot
from hil_sim.monitor.pack_screen import PackScreen, pack_line
from hil_sim.monitor.presets import PresetFinder, preset_finder
from hil_sim.monitor.recognition import BusModel
from hil_sim.monitor.screen import Screen
from hil_sim.monitor.status_line import status_line
from hil_sim.monitor.watch import watch
from hil_sim.nodes.clock import WallClock

SCREEN_REFRESH_S = 0.25
LINE_REFRESH_S = 1.0


def monitor(
    bus: options.SharedBusOption,
    preset: Annotated[
        str | None,
        preset_option("Preset of the ECU, for its limits", "the shipped one that the ECU names"),
    ] = None,
    for_s: Annotated[
        float | None,
        typer.Option("--for-s", min=0.1, help="End after this time in s. Default: q or Ctrl-C."),
    ] = None,
    cells: Annotated[
        int | None,
        typer.Option(
            "--cells",
            min=1,
            max=MOST_CELLS,
            help="A pack of so many cells in series. Default: told by what is on the bus.",
        ),
    ] = None,
) -> int:
    """Show state, temperatures against limits, decision, faults and traffic of a running system.

    Of a pack the weakest cells: which governs and by what, those with the least margin, the spread.
    Listens only: nothing is ever sent. Temperatures in K, currents in A (negative while charging).
    What has not come is n/a, what comes no more is stale. Where the output is no terminal, prints
    one line a second. Ends with q or Ctrl-C.

    Example: bms monitor --bus socketcan:vcan0
    """
    require_shared(bus)
    finder = preset_finder(preset)
    model = BusModel(cells)
    # Neither its start nor a frame waits for this.
    Thread(target=shipped_contents, daemon=True).start()
    clock = WallClock()
    stop = stop_event()
    start_s = clock.now_s()
    end_s = float("inf") if for_s is None else start_s + for_s
    console = Console()
    is_screen = console.is_terminal and not console.is_dumb_terminal and sys.stdout.isatty()
    with ExitStack() as stack:
        listener = stack.enter_context(Listener(bus))
        keyboard = stack.enter_context(Keyboard())
        if is_screen:
            live = stack.enter_context(Live(console=console, screen=True, auto_refresh=False))

        def show(snapshot: Snapshot | PackSnapshot) -> None:
            shown, line = _shown(snapshot, finder, bus, clock.now_s() - start_s)
            if is_screen:
                live.update(shown, refresh=True)
            else:
                print(line, flush=True)

        watch(
            listener,
            model,
            clock,
            SCREEN_REFRESH_S if is_screen else LINE_REFRESH_S,
            end_s,
            lambda: stop.is_set() or keyboard.wants_to_quit(),
            show,
        )
    print(f"watched {bus} for {clock.now_s() - start_s:.1f} s: {model.frames} frames")
    return 0


def _shown(
    snapshot: Snapshot | PackSnapshot, finder: PresetFinder, bus: str, time_s: float
) -> tuple[RenderableType, str]:
    """A snapshot as a screen and as a line."""
    if isinstance(snapshot, PackSnapshot):
        in_force = finder.find(snapshot.identity)
        return PackScreen(snapshot, in_force, bus), pack_line(time_s, snapshot, in_force)
    in_force = finder.find(snapshot.identity, snapshot.refusal)
    return Screen(snapshot, in_force, bus), status_line(time_s, snapshot, in_force)
