"""Takes the steps of a chain in order; what is done and unchanged is not done again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bms import __version__
from bms.errors import InputError
from hil_sim.chain.state import (
    Done,
    State,
    file_hash,
    file_hashes,
    inputs_hash,
    load_state,
    save_state,
)
from hil_sim.chain.steps import PRESET, Outcome, Step


@dataclass(frozen=True)
class Taken:
    """A step with what came of it; `is_kept` tells that it was done before."""

    name: str
    outcome: Outcome
    cpu_s: float
    is_kept: bool


def take_all(
    folder: Path,
    steps: Sequence[Step],
    begun: Callable[[str], None],
    cpu_s: Callable[[], float],
) -> Iterator[Taken]:
    """Each step with its outcome, up to the first that fails.

    The first step makes the preset. `begun` is told the name of a step that begins; `cpu_s` is the
    processor time so far. Raises InputError, also for a preset that was edited after it was made,
    and BusError.
    """
    state = load_state(folder)
    _require_unedited(folder, state, steps[0])
    for step in steps:
        inputs = _inputs(folder, step)
        if state.holds(step.name, inputs, folder):
            done = state.steps[step.name]
            outcome = Outcome(done.said, tuple(done.outputs))
            yield Taken(step.name, outcome, done.cpu_s, is_kept=True)
            continue
        # Whatever it leaves when it is interrupted does not count.
        state = state.with_step(step.name, None)
        save_state(folder, state)
        begun(step.name)
        start_s = cpu_s()
        outcome = step.run(folder)
        took_s = round(cpu_s() - start_s, 1)
        if outcome.passed and not outcome.is_lacking:
            # The preset may have stood among the files already, so inputs are as they are now.
            outputs = file_hashes(folder, outcome.files)
            done = Done(_inputs(folder, step), outputs, outcome.said, took_s)
            state = state.with_step(step.name, done)
            save_state(folder, state)
        yield Taken(step.name, outcome, took_s, is_kept=False)
        if not outcome.passed:
            return


def _inputs(folder: Path, step: Step) -> str:
    return inputs_hash(
        version=__version__, key=step.key, files=file_hashes(folder, step.reads), step=step.name
    )


def _require_unedited(folder: Path, state: State, first: Step) -> None:
    """A preset that somebody edited in the folder would be made anew, and the edit lost."""
    done, path = state.steps.get(first.name), folder / PRESET
    if done is None or not path.is_file() or done.outputs.get(PRESET) == file_hash(path):
        return
    if done.inputs != _inputs(folder, first):
        return
    raise InputError(
        f"{path}: edited since it was made; go on from it with --preset {path} in place of the "
        "recordings, or remove it to have it made anew"
    )
