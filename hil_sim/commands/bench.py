"""`bms bench`: what the firmware and the simulation cost, beside other ways to the same answers."""

from __future__ import annotations

import json
import sys
import time
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import DEFAULT_PROCESSES, JsonOption, PresetOption
from bms.errors import InputError
from bms.presets import DEFAULT_PRESET
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.studies.bench.outcome import outcome_json
from hil_sim.studies.bench.race import Clocks, WrongAnswerError
from hil_sim.studies.bench.run import FULL, QUICK, Section, run_benchmark, step_count
from hil_sim.studies.bench.simulation import BUSES
from hil_sim.studies.bench.tables import print_tables

CAMPAIGN_RUNS = (100, 1000, 10_000)
QUICK_CAMPAIGN_RUNS = (20,)
QUICK_BUSES = BUSES[:1]


def bench(
    section: Annotated[
        list[Section] | None,
        typer.Option("--section", help="Only this one. May be repeated. Default: all."),
    ] = None,
    preset: PresetOption = DEFAULT_PRESET,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="A first look in seconds; --bus virtual only by default."),
    ] = False,
    bus: Annotated[
        list[str] | None,
        typer.Option(
            "--bus",
            help="Bus to simulate on. May be repeated. Default: virtual, udp_multicast and "
            "socketcan:vcan0, in the guest where the machine has none.",
        ),
    ] = None,
    campaign_runs: Annotated[
        list[int] | None,
        typer.Option(
            "--campaign-runs",
            min=1,
            help="Size of a campaign. May be repeated. Default: 100, 1000 and 10000 (minutes).",
        ),
    ] = None,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    as_json: JsonOption = False,
) -> int:
    """Time estimate, decision, control period, simulation and campaign, and count on the boards.

    All ways to an answer are given the states of the same simulated charge, and their answers are
    compared before they are timed; exit code 1 when they differ. Medians of repetitions with
    quartiles. What is not installed is named as not run.

    Example: bms bench --section estimate --section decision --json
    """
    buses = bus or list(QUICK_BUSES if quick else BUSES)
    for name in buses:
        if not all(name.partition(":")):
            raise InputError(f"--bus '{name}': not interface:channel; write for example {BUSES[0]}")
    sections = set(section or Section)
    sizes = campaign_runs or list(QUICK_CAMPAIGN_RUNS if quick else CAMPAIGN_RUNS)
    count = step_count(sections, buses, sizes)
    try:
        with waiting("timing", count, "steps") as wait:
            result = run_benchmark(
                sections,
                preset,
                QUICK if quick else FULL,
                buses,
                sizes,
                jobs,
                Clocks(time.perf_counter_ns, time.process_time_ns),
                wait.begin,
            )
    except WrongAnswerError as error:
        print(f"bms: {error}", file=sys.stderr)
        return EXIT_CHECK_FAILED
    if as_json:
        chosen = {"preset": preset, "quick": quick}
        print(json.dumps(chosen | outcome_json(result), indent=2))
    else:
        print_tables(Console(), result)
    return EXIT_DONE
