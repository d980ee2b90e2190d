"""What of a chain is done: a file with the hashes of what each step read and wrote."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from bms.errors import InputError
from bms.files import write_text
from bms.presets.digest import digest
from bms.validation import NonNegative, parse, read_json, strict

STATE_FILE = "cell.json"
FORMAT = 1


@strict
@dataclass(frozen=True)
class Done:
    """A step that is done: hash of all that it depends on, hashes of its files, what it said.

    `cpu_s` is the processor time that it took, all processes together.
    """

    inputs: str
    outputs: dict[str, str]
    said: str
    cpu_s: NonNegative


@strict
@dataclass(frozen=True)
class State:
    """All steps that are done, by name."""

    format: int = FORMAT
    steps: dict[str, Done] = field(default_factory=dict)

    def holds(self, step: str, inputs: str, folder: Path) -> bool:
        """Whether the step was done for these inputs, and its files are still what it wrote."""
        done = self.steps.get(step)
        return (
            done is not None
            and done.inputs == inputs
            and done.outputs == file_hashes(folder, done.outputs)
        )

    def with_step(self, step: str, done: Done | None) -> State:
        """The state with a step done, or not done with None."""
        others = {name: one for name, one in self.steps.items() if name != step}
        return State(self.format, others if done is None else {**others, step: done})


def load_state(folder: Path) -> State:
    """The state of a folder, an empty one where there is none or one of another version.

    Raises InputError for a file that cannot be read.
    """
    path = folder / STATE_FILE
    if not path.is_file():
        return State()
    content = read_json(path)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return State()
    return parse(State, content, str(path))


def save_state(folder: Path, state: State) -> None:
    """Write the state at once or not at all; InputError when that cannot be done."""
    write_text(folder / STATE_FILE, json.dumps(asdict(state), indent=1) + "\n")


def file_hashes(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of files in a folder by name; those that are absent are left out."""
    return {name: file_hash(folder / name) for name in names if (folder / name).is_file()}


def file_hash(path: Path) -> str:
    """SHA-256 of a file as hexadecimal text; InputError when it cannot be read."""
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be read ({reason}); check the path") from None
    return hashlib.sha256(content).hexdigest()


def inputs_hash(**parts: Mapping[str, object] | str | int | bool | None) -> str:
    """Hash of all that a step depends on."""
    return digest(parts)
