"""Draws docs/images/monitor.svg: the screen in the middle of a golden log.

    python -m tests.hil_sim.monitor_picture

The same log gives the same bytes. To run again after the golden logs were recorded anew.
"""

from __future__ import annotations

import io
from pathlib import Path

from rich.console import Console

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import load_codecs
from hil_sim.logs import read_log
from hil_sim.monitor.model import Snapshot, SystemModel
from hil_sim.monitor.presets import preset_finder
from hil_sim.monitor.screen import Screen
from tests.hil_sim.golden.record import FOLDER

PICTURE = Path(__file__).parents[2] / "docs" / "images" / "monitor.svg"
LOG, TIME_S = FOLDER / "hot_derating.log.gz", 25.0
COLUMNS, ROWS = 80, 24


def snapshot_of(log: Path, time_s: float, age_s: float = 0.0) -> Snapshot:
    """What a monitor knew age_s after the last frame of a log up to time_s."""
    model = SystemModel(load_codecs())
    for frame in read_log(log):
        if frame.time_s <= time_s:
            model.take(frame.time_s, Frame(frame.frame_id, frame.data))
    return model.snapshot(time_s + age_s)


def drawn(snapshot: Snapshot, columns: int, rows: int, preset: str | None = None) -> Console:
    """A console of that size with the screen recorded on it; `preset` as in --preset."""
    console = Console(
        file=io.StringIO(), record=True, width=columns, height=rows, color_system="truecolor"
    )
    screen = Screen(snapshot, preset_finder(preset).find(snapshot.identity), "socketcan:vcan0")
    console.print(screen, height=rows, end="")
    return console


def picture() -> str:
    """The SVG."""
    return drawn(snapshot_of(LOG, TIME_S), COLUMNS, ROWS).export_svg(title="bms monitor")


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
