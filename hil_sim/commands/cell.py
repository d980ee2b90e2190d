"""`bms cell`: all that lies between a cell's data and the calibration in flash."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands import surface_options
from bms.commands.identify_surface import has_measured_core
from bms.commands.options import DEFAULT_PROCESSES, JsonOption, out_folder_option, seed_option
from bms.data.measurements import read_measurements
from bms.errors import InputError
from bms.files import make_folder, write_text
from bms.presets import preset_path
from hil_sim.chain.run import Taken, take_all
from hil_sim.chain.steps import (
    Choices,
    Step,
    preset_from_file,
    preset_from_recordings,
    steps_after_preset,
)
from hil_sim.commands.options import JobsOption
from hil_sim.report.page import render_page

REPORT = "report.html"


def cell(
    data: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[DATA]...", help="Recordings of a cycler, CSV or TXT, for bms identify."
        ),
    ] = None,
    *,
    out: Annotated[Path, out_folder_option("preset, model, report and calibration.bin", None)],
    preset: Annotated[
        str | None,
        typer.Option(
            "--preset",
            help="Preset to start from in place of recordings: name of a shipped one, or path of "
            "a TOML file.",
        ),
    ] = None,
    columns: surface_options.ColumnsOption = None,
    temperature_unit: surface_options.TemperatureUnitOption = "K",
    charge_is_positive: surface_options.ChargeSignOption = False,
    sample_period_s: surface_options.SamplePeriodOption = None,
    geometry: surface_options.GeometryOption = None,
    rated: surface_options.RatedOption = None,
    entropy: surface_options.EntropyOption = None,
    check: surface_options.CheckOption = None,
    seed: Annotated[int, seed_option("data, training and sensor noise")] = 0,
    jobs: JobsOption = DEFAULT_PROCESSES,
    as_json: JsonOption = False,
) -> int:
    """Make a cell's preset, model, certificate, charge, fault matrix and calibration from its data.

    DATA are recordings, read and fitted as by 'bms identify', which knows the options too; with
    --preset there is a preset already.

    What is done and unchanged is not done again, so that an interrupted call goes on where it was.
    The first step that fails ends it, with the cause, and exit code 1. Temperatures in K, currents
    in A (negative while charging). The last step charges against the image of 'make firmware' in
    QEMU, and says so where there is none.

    Example: bms cell --preset my_cell.toml --out my_cell
    """
    chosen = surface_options.SurfaceOptions(
        tuple(columns or ()),
        temperature_unit,
        charge_is_positive,
        sample_period_s,
        geometry or None,
        tuple(rated or ()),
        entropy,
        check,
    )
    first = _first_step(data or [], chosen, preset)
    steps = (first, *steps_after_preset(Choices(seed, jobs)))
    make_folder(out)
    console = Console(stderr=as_json)
    taken: list[Taken] = []
    number = {step.name: place + 1 for place, step in enumerate(steps)}
    for one in take_all(out, steps, lambda name: None, _cpu_s):
        taken.append(one)
        how = "as before" if one.is_kept else f"{one.cpu_s:.1f} s"
        line = f"{number[one.name]}/{len(steps)} {one.name}: {one.outcome.said} ({how})"
        console.print(line, markup=False, highlight=False)
        write_text(out / REPORT, _page(out, taken, len(steps)))
    verdict = _verdict(taken, len(steps))
    if as_json:
        content = {"passed": _passed(taken, len(steps)), "verdict": verdict, "steps": _told(taken)}
        print(json.dumps(content, indent=1))
    else:
        console.print(f"{out / REPORT}: {verdict}", markup=False, highlight=False, soft_wrap=True)
    return EXIT_DONE if _passed(taken, len(steps)) else EXIT_CHECK_FAILED


def _first_step(
    files: Sequence[Path], chosen: surface_options.SurfaceOptions, preset: str | None
) -> Step:
    if preset is not None:
        if files or chosen.is_given:
            raise InputError(
                f"--preset {preset}: takes the place of recordings and of what is said of them; "
                "give one of both"
            )
        return preset_from_file(preset_path(preset))
    if not files:
        raise InputError("cell: nothing to start from; give recordings, or --preset FILE")
    if not chosen.is_given and has_measured_core(files[0]):
        # What is wrong with the file itself comes first: no recording, degC, another sign.
        read_measurements(files[0], core_may_be_copied=True)
        raise InputError(
            f"{files[0]}: has a measured core; identify it with 'bms identify "
            "--data CSV --preset PRESET --out FILE', then go on with --preset"
        )
    return preset_from_recordings(files, chosen)


def _passed(taken: Sequence[Taken], steps: int) -> bool:
    return len(taken) == steps and all(one.outcome.passed for one in taken)


def _verdict(taken: Sequence[Taken], steps: int) -> str:
    last = taken[-1]
    if not last.outcome.passed:
        return f"stopped at {last.name}: {last.outcome.said}"
    if len(taken) < steps:
        return f"{last.name} is done"
    lacking = [one for one in taken if one.outcome.is_lacking]
    but = "".join(f"; {one.name} {one.outcome.said}" for one in lacking)
    return f"complete in {sum(one.cpu_s for one in taken):.0f} s of processor time{but}"


def _told(taken: Sequence[Taken]) -> list[dict[str, object]]:
    return [
        {
            "step": one.name,
            "said": one.outcome.said,
            "passed": one.outcome.passed,
            "kept": one.is_kept,
            "not_run": one.outcome.is_lacking,
            "cpu_s": one.cpu_s,
            "files": list(one.outcome.files),
        }
        for one in taken
    ]


def _page(out: Path, taken: Sequence[Taken], steps: int) -> str:
    return render_page(
        "chain.html.j2",
        name=out.resolve().name,
        taken=taken,
        passed=taken[-1].outcome.passed,
        verdict=_verdict(taken, steps),
    )


def _cpu_s() -> float:
    """Processor time of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
