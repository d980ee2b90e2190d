"""`bms compare-targets`: one firmware on the host, as a native process and on microcontrollers."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import JsonOption
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from bms.text_table import TextTable, red
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.commands.fault_matrix import chosen_rows
from hil_sim.commands.replay_output import first_json, first_table, unread_json
from hil_sim.fault_matrix.matrix import Row, load_matrix
from hil_sim.fault_matrix.runner import MatrixSettings
from hil_sim.logs import Selection, described
from hil_sim.replay.signals import Signals
from hil_sim.targets.agreement import Agreement, FrameDifference, agreements_with_host
from hil_sim.targets.catalog import BUILD, NAMES, find_target
from hil_sim.targets.scenarios import (
    Scenario,
    load_scenarios,
    record_scenarios,
    why_not_played,
)

HOST = "host"


def compare_targets(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Logs of runs in lock step to compare on. Default: a full charge and the fault "
            "matrix, recorded anew."
        ),
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target", help=f"One of {', '.join(NAMES)}. May be repeated. Default: all of them."
        ),
    ] = None,
    rows: options.RowsOption = None,
    seed: options.SeedOption = 0,
    build: Annotated[
        Path, typer.Option("--build", help="Folder that 'make firmware' writes to.")
    ] = BUILD,
    channel: options.ChannelOption = None,
    delta_times: options.DeltaTimesOption = False,
    as_json: JsonOption = False,
) -> int:
    """Compare the firmware on other targets with that in this process, frame by frame.

    Full charge and faults are played in closed loop on the host (cffi, virtual bus). Then each
    target gets the same frames in lock step, and everything that it says has to be the same, byte
    for byte. Shows the first difference with period, frames and both sides' signals. Exit code 1
    when anything differs.

    Example: bms compare-targets --target qemu:mps2-an386 --rows corrupted
    """
    targets = [find_target(name, build) for name in dict.fromkeys(target or NAMES)]
    if logs and rows:
        raise InputError("--rows: the logs are what is compared; leave one of them out")
    matrix = [] if logs else chosen_rows(load_matrix(), rows)
    left_out = {row.name: reason for row in matrix if (reason := why_not_played(row)) is not None}
    playable = [row for row in matrix if row.name not in left_out]
    recorded = load_scenarios(logs, Selection(channel, delta_times)) if logs else None
    for place in targets:
        place.require_place()
    count = (len(logs) if logs else 1 + len(playable)) * (len(targets) + (not logs))
    with waiting("playing on host and targets", count, "runs") as wait:
        scenarios = recorded or _recorded(seed, playable, wait.advance)
        agreements = agreements_with_host(targets, scenarios, wait.advance)
    if as_json:
        print(json.dumps(_json(scenarios, agreements, left_out), indent=2))
    else:
        _print(Console(), scenarios, agreements, left_out)
    return EXIT_DONE if _is_equal(agreements) else EXIT_CHECK_FAILED


def _recorded(seed: int, rows: list[Row], progress: Callable[[], None]) -> list[Scenario]:
    settings = MatrixSettings(*load_pair(DEFAULT_PRESET, None), seed=seed)
    return record_scenarios(settings, rows, progress)


def _is_equal(agreements: Sequence[Sequence[Agreement]]) -> bool:
    return all(one.comparison.is_equal for by_target in agreements for one in by_target)


def _json(
    scenarios: Sequence[Scenario],
    agreements: Sequence[Sequence[Agreement]],
    left_out: dict[str, str],
) -> dict[str, Any]:
    return {
        "equal": _is_equal(agreements),
        "scenarios": [
            {
                "name": scenario.name,
                "periods": len(scenario.recording.periods),
                "frames": _frame_count(scenario),
                "unread": unread_json(scenario.recording.unread),
                "targets": {one.target: _agreement_json(one) for one in by_scenario},
            }
            for scenario, *by_scenario in zip(scenarios, *agreements)
        ],
        "not_played": left_out,
    }


def _frame_count(scenario: Scenario) -> int:
    return sum(len(p.received) + len(p.answer) for p in scenario.recording.periods)


def _agreement_json(agreement: Agreement) -> dict[str, Any]:
    comparison = agreement.comparison
    signals = Signals(agreement.scenario.recording.database)
    first = comparison.first
    return {
        "equal": comparison.is_equal,
        "differing_periods": comparison.differing_periods,
        "first_difference": None
        if first is None
        else {
            **first_json(first, signals, (HOST, "target")),
            "frames": [
                {
                    "id": f"{frame.frame_id:03X}",
                    "message": frame.message,
                    HOST: _hex(frame.host),
                    "target": _hex(frame.target),
                }
                for frame in agreement.frames
            ],
        },
    }


def _print(
    console: Console,
    scenarios: Sequence[Scenario],
    agreements: Sequence[Sequence[Agreement]],
    left_out: dict[str, str],
) -> None:
    targets = (by_target[0].target for by_target in agreements)
    table = TextTable("run on the host", "periods", "frames", *targets)
    for scenario, *by_scenario in zip(scenarios, *agreements):
        counts = (len(scenario.recording.periods), _frame_count(scenario))
        cells = [_verdict(agreement) for agreement in by_scenario]
        table.add_row(scenario.name, *map(str, counts), *cells)
    table.print(console)
    for by_target in agreements:
        differing = [one for one in by_target if not one.comparison.is_equal]
        if differing:
            _print_first(console, differing[0])
    for scenario in scenarios:
        if scenario.recording.unread:
            _say(console, f"{scenario.name}: not read: {described(scenario.recording.unread)}")
    for name, reason in left_out.items():
        _say(console, f"not played: {name}: {reason}")
    frames = sum(map(_frame_count, scenarios))
    for by_target in agreements:
        same = sum(one.comparison.is_equal for one in by_target)
        text = f"{by_target[0].target}: {same} of {len(scenarios)} runs the same byte for byte"
        style = "green" if same == len(scenarios) else "red"
        console.print(f"[{style}]{escape(text)}[/{style}] ({frames} frames)", highlight=False)


def _verdict(agreement: Agreement) -> str | Text:
    first = agreement.comparison.first
    return "same" if first is None else red(f"differs from period {first.period}")


def _print_first(console: Console, agreement: Agreement) -> None:
    first = agreement.comparison.first
    assert first is not None
    name = f"{agreement.scenario.name} on {agreement.target}"
    _say(console, f"{name}: first difference in period {first.period}, {first.time_s:.3f} s")
    for frame in agreement.frames:
        _say(console, f"  {_difference(frame, agreement.target)}")
    signals = Signals(agreement.scenario.recording.database)
    first_table(first, signals, (HOST, agreement.target)).print(console)


def _difference(frame: FrameDifference, target: str) -> str:
    sides = (f"{HOST} {_hex(frame.host) or 'none'}", f"{target} {_hex(frame.target) or 'none'}")
    return f"frame {frame.frame_id:03X} {frame.message}: {', '.join(sides)}"


def _hex(data: bytes | None) -> str | None:
    return None if data is None else data.hex().upper()


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
