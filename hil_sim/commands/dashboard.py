"""`bms dashboard`: a page in a browser, of a simulated charge or of a running bus."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec
from typing import Annotated

import typer

from bms.commands.options import ModelOption, preset_option
from bms.errors import InputError
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.buses import require_shared
from hil_sim.commands.stopping import stop_event
from hil_sim.dashboard.build import require_page
from hil_sim.monitor.presets import preset_finder
from hil_sim.nodes.clock import WallClock

DEFAULT_PORT = 8765
_NEEDED = ("starlette", "uvicorn", "websockets")


def dashboard(
    bus: Annotated[
        str | None,
        typer.Option(
            "--bus",
            help="Show this running bus, e.g. socketcan:vcan0; it is listened to only. "
            "Default: a charge that is simulated in the page.",
        ),
    ] = None,
    preset: Annotated[
        str,
        preset_option("Preset that the page begins with", DEFAULT_PRESET),
    ] = DEFAULT_PRESET,
    model: ModelOption = None,
    port: Annotated[
        int,
        typer.Option(
            "--port", min=0, max=65535, help="Port on this machine; 0 takes any that is free."
        ),
    ] = DEFAULT_PORT,
    for_s: Annotated[
        float | None,
        typer.Option("--for-s", min=0.1, help="End after this time in s. Default: Ctrl-C."),
    ] = None,
) -> int:
    """Serve a page in which the firmware charges a cell, or that shows a running bus.

    The firmware and its plant run in the page itself, as WebAssembly; nothing is sent on a bus. The
    page is for this machine alone (127.0.0.1). Ends with Ctrl-C.

    Example: bms dashboard --bus socketcan:vcan0
    """
    missing = [name for name in _NEEDED if find_spec(name) is None]
    if missing:
        raise InputError(
            f"dashboard: {', '.join(missing)} not installed; "
            "install it with \"python -m pip install 'kan-rcbf-bms[dashboard]'\""
        )
    require_page()
    from hil_sim.dashboard.feed import BusFeed  # noqa: PLC0415 (needs the extra)
    from hil_sim.dashboard.server import Server, make_app  # noqa: PLC0415

    stop = stop_event()
    with ExitStack() as stack:
        feed = None
        if bus is not None:
            require_shared(bus)
            feed = stack.enter_context(BusFeed(bus, preset_finder(None), WallClock()))
        server = Server(make_app(preset, model, bus, feed), port)
        stack.callback(server.close)
        print(f"{server.address} (Ctrl-C ends)", flush=True)
        stop.wait(for_s)
    return 0
