"""`bms replay`: a recorded log on the present firmware, or many logs on two builds of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import JsonOption, model_option, preset_option
from bms.errors import InputError
from bms.firmware import Ecu
from bms.presets import DEFAULT_PRESET
from bms.waiting import waiting
from hil_sim.commands import pack_options
from hil_sim.commands.options import ChannelOption, DeltaTimesOption
from hil_sim.commands.replay_output import ReplayReport, builds_json, print_builds
from hil_sim.logs import Selection, usable_format
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.replay.builds import compare_builds, logs_in
from hil_sim.replay.comparison import compare
from hil_sim.replay.content import foreign_content_of
from hil_sim.replay.engine import replay as replay_recording
from hil_sim.replay.engine import write_replayed
from hil_sim.replay.identity import choose_pair, identity_to_ignore
from hil_sim.replay.outcome import outcome
from hil_sim.replay.recording import load_recording
from hil_sim.replay.signals import Signals
from hil_sim.report.folder import OutputFolder


def replay(
    log: Annotated[
        Path,
        typer.Argument(
            help="Log as .log, .asc, .csv, .trc (also .gz), .blf or .mf4; "
            "a folder of them for --against."
        ),
    ],
    preset: Annotated[
        str | None,
        preset_option("Preset of the ECU", "the one that the log names"),
    ] = None,
    model: Annotated[
        Path | None,
        model_option("Model of the estimator", "the one that the log names"),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Log to write with the new answers. Default: none."),
    ] = None,
    against: Annotated[
        tuple[Path, Path] | None,
        typer.Option(
            "--against",
            help="Compare two builds made by 'python -m bms.native_build --out FOLDER' on a folder "
            "of logs.",
        ),
    ] = None,
    channel: ChannelOption = None,
    delta_times: DeltaTimesOption = False,
    as_json: JsonOption = False,
    cells: pack_options.CellsOption = None,
    spread: pack_options.SpreadOption = SpreadKind.PUBLISHED,
    per_thermistor: pack_options.PerThermistorOption = 1,
    thermistors: pack_options.ThermistorsOption = None,
) -> int:
    """Feed the frames of a log to the firmware in virtual time and compare its decisions.

    Shows the first period in which what the ECU sends differs from the log, with measurements and
    both sides' estimate, interval, margins and state, then the largest difference of each signal.
    What is in the log besides classical data frames is counted. Exit code 1 when anything differs,
    2 when a log cannot be used. With --cells it is the log of a pack, in lock step.

    Example: bms replay out/run/can.log
    """
    selection = Selection(channel, delta_times)
    if cells is not None:
        pack_options.refuse_options({"--out": out is not None, "--against": against is not None})
        from hil_sim.commands.pack_charge import pack_settings  # noqa: PLC0415 (only for a pack)
        from hil_sim.commands.pack_replay import replay_and_print  # noqa: PLC0415

        settings = pack_settings(
            preset or DEFAULT_PRESET,
            model,
            cells,
            "virtual:bms",
            spread,
            per_thermistor,
            thermistors=thermistors,
        )
        return replay_and_print(log, settings, selection, as_json)
    pack_options.refuse_pack_options(spread, per_thermistor, thermistors)
    if against is not None:
        if out is not None:
            raise InputError("--out: there are two answers with --against; leave one of them out")
        return _against(against, log, selection, preset, model, as_json)
    return _replay(log, selection, preset, model, out, as_json)


def _replay(
    log: Path,
    selection: Selection,
    preset: str | None,
    model: Path | None,
    out: Path | None,
    as_json: bool,
) -> int:
    if out is not None:
        usable_format(out)
    with waiting("replaying", 3, "parts") as wait:
        wait.begin(f"reading {log.name}")
        recording = load_recording(log, selection)
        wait.begin("replaying")
        ecu = Ecu(*choose_pair(recording, preset, model))
        answers = replay_recording(recording, ecu)
        wait.begin("comparing")
        ignored = identity_to_ignore(recording, ecu.preset, ecu.model)
        signals = Signals(recording.database)
        comparison = compare(recording, signals, recording.answers, answers, ignored)
    if out is not None:
        with OutputFolder(out.parent) as folder:
            write_replayed(folder.path(out.name), recording, answers)
            folder.commit()
    report = ReplayReport(
        recording=recording,
        signals=signals,
        comparison=comparison,
        outcomes=(
            outcome(recording, signals, recording.answers),
            outcome(recording, signals, answers),
        ),
        preset=ecu.preset.name,
        model_hash=ecu.model.hash[:8],
        is_identity_compared=not ignored,
        foreign_content=foreign_content_of(recording, ecu.preset, ecu.model),
    )
    if as_json:
        print(json.dumps(report.to_json(), indent=2))
    else:
        report.print(Console())
    return EXIT_DONE if comparison.is_equal else EXIT_CHECK_FAILED


def _against(
    builds: tuple[Path, Path],
    folder: Path,
    selection: Selection,
    preset: str | None,
    model: Path | None,
    as_json: bool,
) -> int:
    logs = logs_in(folder)
    with waiting("replaying on both builds", len(builds) * len(logs), "replays") as wait:
        verdicts = compare_builds(builds, logs, preset, model, selection, wait.advance)
    if as_json:
        print(json.dumps(builds_json(builds, verdicts), indent=2))
    else:
        print_builds(Console(), builds, verdicts)
    is_equal = all(verdict.comparison.is_equal for verdict in verdicts)
    return EXIT_DONE if is_equal else EXIT_CHECK_FAILED
