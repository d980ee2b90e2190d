"""Two builds of the firmware on the same logs: what would the change have done differently."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.errors import InputError
from bms.native_build import FIRMWARE
from hil_sim.bus.buses import Frame
from hil_sim.logs import ALL, Selection, Unread, log_suffixes
from hil_sim.replay.comparison import Comparison, compare
from hil_sim.replay.outcome import outcome
from hil_sim.replay.recording import Answer, load_recording
from hil_sim.replay.signals import Signals
from hil_sim.replay.worker import UNUSABLE


@dataclass(frozen=True)
class LogVerdict:
    """How two builds A and B differ on one log.

    The current is in A, the charge in Ah and B's less A's; faults are those that only one raised.
    """

    log: Path
    comparison: Comparison
    largest_current_difference_A: float
    charge_difference_Ah: float
    new_faults: tuple[str, ...]
    gone_faults: tuple[str, ...]
    unread: Mapping[Unread, int]


def logs_in(folder: Path) -> list[Path]:
    """The logs directly in a folder, by name; InputError when there are none."""
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder; give one with logs")
    suffixes = tuple(log_suffixes())
    logs = sorted(p for p in folder.iterdir() if p.name.lower().endswith(suffixes) and p.is_file())
    if not logs:
        raise InputError(f"{folder}: no log is in it; record some with 'bms sil --log FILE'")
    return logs


def compare_builds(
    builds: tuple[Path, Path],
    logs: Sequence[Path],
    preset: str | None,
    model: Path | None,
    selection: Selection = ALL,
    advance: Callable[[int], None] = lambda replays: None,
) -> list[LogVerdict]:
    """Replay logs on two builds, each in a process of its own, and compare what they answer.

    `advance` gets how many replays were done. Raises InputError for a build or log that cannot be
    used.
    """
    for build in builds:
        FIRMWARE.find_build(build)
    with ThreadPoolExecutor(len(builds)) as pool:
        futures = [pool.submit(_answers, build, logs, preset, model, selection) for build in builds]
        for future in as_completed(futures):
            advance(0 if future.exception() else len(logs))
        both = [future.result() for future in futures]
    return [_verdict(log, selection, one, other) for log, one, other in zip(logs, *both)]


def _verdict(log: Path, selection: Selection, one: list[Answer], other: list[Answer]) -> LogVerdict:
    recording = load_recording(log, selection)
    signals = Signals(recording.database)
    before, after = (outcome(recording, signals, answers) for answers in (one, other))
    return LogVerdict(
        log,
        compare(recording, signals, one, other),
        max(abs(a - b) for a, b in zip(before.currents_A, after.currents_A)),
        after.charge_Ah - before.charge_Ah,
        tuple(signals.faults(after.fault_bits & ~before.fault_bits)),
        tuple(signals.faults(before.fault_bits & ~after.fault_bits)),
        recording.unread,
    )


def _answers(
    build: Path,
    logs: Sequence[Path],
    preset: str | None,
    model: Path | None,
    selection: Selection,
) -> list[list[Answer]]:
    options = [] if preset is None else [f"--preset={preset}"]
    options += [] if model is None else [f"--model={model}"]
    options += [] if selection.channel is None else [f"--channel={selection.channel}"]
    options += ["--delta-times"] if selection.delta_times else []
    with TemporaryDirectory() as folder:
        out = Path(folder) / "answers.json"
        paths = [str(path) for path in (build, out, *logs)]
        command = [sys.executable, "-m", "hil_sim.replay.worker", *options, "--", *paths]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        said = done.stderr.splitlines() or [""]
        if done.returncode == UNUSABLE:
            raise InputError(said[-1])
        if done.returncode:
            raise InputError(
                f"build {build}: fails with exit code {done.returncode} ({said[-1]}); mend it first"
            )
        answers = json.loads(out.read_text(encoding="utf-8"))
    return [
        [tuple(Frame(frame_id, bytes.fromhex(data)) for frame_id, data in period) for period in log]
        for log in answers
    ]
