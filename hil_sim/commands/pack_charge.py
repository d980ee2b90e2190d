"""What `bms sil`, `bms plant` and `bms ecu` do with --cells: a pack in place of one cell."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.model.pair import load_pair
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.bus.buses import open_bus, require_shared
from hil_sim.commands.recordings import outputs
from hil_sim.commands.stopping import stop_event
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.ecu import EcuNode
from hil_sim.pack.charge import PackResult, charge_pack, charge_pack_elsewhere
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.report import write_pack_report
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.pack.summary import has_passed, summary
from hil_sim.pack.thermistor_map import thermistor_map


class Charge(Protocol):
    """A way to charge a pack."""

    def __call__(
        self, settings: PackChargeSettings, recorder: Recorder | None = None, progress: Any = ...
    ) -> PackResult:
        """Charge to the end; `progress` is told the greatest state of charge."""
        ...


def pack_settings(
    preset: str,
    model: Path | str | None,
    cells: int,
    bus: str,
    spread: SpreadKind,
    per_thermistor: int = 1,
    seed: int = 0,
    max_time_s: float = 3600.0,
    answer_timeout_s: float = 1.0,
    thermistors: Path | None = None,
) -> PackChargeSettings:
    """What the options say. Raises InputError or ModelMismatchError."""
    chosen, estimator = load_pair(preset, model)
    settings = PackChargeSettings(
        chosen,
        estimator,
        cells,
        bus=bus,
        spread=spread,
        seed=seed,
        per_thermistor=per_thermistor,
        max_time_s=max_time_s,
        answer_timeout_s=answer_timeout_s,
        thermistor_at=thermistor_map(thermistors, cells, per_thermistor),
    )
    settings.core()  # what cannot be is said before a run
    return settings


def charge_and_report_pack(
    settings: PackChargeSettings,
    charge: Charge,
    out: Path | None,
    as_json: bool,
    log: Path | None,
) -> int:
    """Charge a pack, print and write what came of it, and return the exit code."""
    with outputs(out, log) as kept:
        with kept.recorder() as recorder, waiting("charging", 100, "% state of charge") as wait:
            done = 0

            def follow(soc: float) -> None:
                nonlocal done
                step = int(100.0 * soc) - done
                if step > 0:
                    wait.advance(step)
                    done += step

            result = charge(settings, recorder, follow)
        if kept.folder is not None:
            write_pack_report(kept.folder, result)
        kept.commit()
    if as_json:
        print(json.dumps(summary(result), indent=2))
    else:
        _print(result)
    return EXIT_DONE if has_passed(result) else EXIT_CHECK_FAILED


def sil_pack(
    settings: PackChargeSettings, out: Path | None, as_json: bool, log: Path | None
) -> int:
    """Plant and ECU of a pack in this process."""
    return charge_and_report_pack(settings, charge_pack, out, as_json, log)


def plant_pack(
    settings: PackChargeSettings, out: Path | None, as_json: bool, log: Path | None
) -> int:
    """The plant of a pack, with its ECU in another process."""
    return charge_and_report_pack(settings, charge_pack_elsewhere, out, as_json, log)


def ecu_pack(settings: PackChargeSettings, silence_s: float) -> int:
    """A pack's ECU until the bus falls silent, or until Ctrl-C or SIGTERM."""
    require_shared(settings.bus)
    ecu = PackEcu(settings)
    stop = stop_event()
    with open_bus(settings.bus) as connection:
        if sys.stderr.isatty():
            print(
                f"ECU of {settings.cells} cells on {settings.bus}; Ctrl-C ends it", file=sys.stderr
            )
        node = EcuNode(connection, ecu)
        node.run(silence_s, stop.is_set)
    print(f"ECU on {settings.bus}: {node.frames} frames received, {node.steps} steps")
    return EXIT_DONE


def _print(result: PackResult) -> None:
    content = summary(result)
    table = TextTable(
        "cell", "core K", "surface K", "voltage mV", "soc", "governed s",
        title=f"{content['cells']} cells of {content['preset']}: {content['stop_reason']} after "
        f"{content['charge_time_s']:.1f} s; left of each limit at worst",
    )  # fmt: skip
    rows = sorted(content["worst_margins"], key=lambda row: float(row["core_temperature_K"]))
    for row in rows[:8]:
        table.add_row(
            str(row["cell"]),
            f"{row['core_temperature_K']:.2f}",
            f"{row['surface_temperature_K']:.2f}",
            f"{1000.0 * row['voltage_V']:.1f}",
            f"{row['soc']:.4f}",
            f"{content['governed_s'].get(str(row['cell']), 0.0):.1f}",
        )
    console = Console()
    table.print(console)
    for cell, plant in content["cell_plants"].items():
        console.print(f"cell {cell} is {plant}", highlight=False, markup=False)
    if content["min_anode_potential_V"] is not None:
        console.print(f"least anode potential {content['min_anode_potential_V']:.4f} V")
    fault = f"; first fault {content['first_fault']}" if content["first_fault"] else ""
    console.print(
        f"{content['cells_over']} cells over a limit{fault}; {content['frames_per_period']:.1f} "
        f"frames a period, {content['times_real_time']:.0f} times real time"
    )
