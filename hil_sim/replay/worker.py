"""A process that replays logs on one build of the firmware; see hil_sim.replay.builds.

    python -m hil_sim.replay.worker BUILD OUT [--preset P] [--model M] LOG...

The extension is put in place before anything imports the installed one. OUT becomes JSON: for each
log the frames of each period.
"""

from __future__ import annotations

import argparse
import json
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from bms.errors import BmsError, InputError
from hil_sim.replay.engine import replay
from hil_sim.replay.recording import load_recording

EXTENSION = "bms.firmware._firmware"
UNUSABLE = 2
"""Exit code when a build or log cannot be used and stderr says why."""
REMEDY = "make one with 'python -m bms.native_build --tree TREE --out FOLDER'"


def find_extension(folder: Path) -> Path:
    """The extension of a build; InputError when it is none."""
    for suffix in EXTENSION_SUFFIXES:  # those of other Python versions may lie beside it
        path = folder / "bms" / "firmware" / f"_firmware{suffix}"
        if path.is_file():
            return path.resolve()
    raise InputError(f"{folder}: not a build of the firmware; {REMEDY}")


def load_build(folder: Path) -> None:
    """Put the extension of a build in the place of the installed one; InputError if it cannot."""
    spec = spec_from_file_location(EXTENSION, find_extension(folder))
    assert spec is not None and spec.loader is not None
    assert EXTENSION not in sys.modules, "too late: another build is loaded already"
    try:
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{folder}: cannot be loaded ({reason}); {REMEDY}") from None
    sys.modules[EXTENSION] = module


def main() -> None:
    """Run the process; what is unusable becomes one line on stderr and exit code 2."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("build", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--preset")
    parser.add_argument("--model", type=Path)
    parser.add_argument("logs", type=Path, nargs="+")
    arguments = parser.parse_args()
    try:
        load_build(arguments.build)
        answers = [_replay(log, arguments.preset, arguments.model) for log in arguments.logs]
    except BmsError as error:
        print(error, file=sys.stderr)
        sys.exit(UNUSABLE)
    arguments.out.write_text(json.dumps(answers), encoding="utf-8")


def _replay(log: Path, preset: str | None, model: Path | None) -> list[list[tuple[int, str]]]:
    from bms.firmware import Ecu  # noqa: PLC0415 -- only now is the right build in place
    from hil_sim.replay.identity import choose_pair  # noqa: PLC0415

    recording = load_recording(log)
    answers = replay(recording, Ecu(*choose_pair(recording, preset, model)))
    return [[(frame.frame_id, frame.data.hex()) for frame in answer] for answer in answers]


if __name__ == "__main__":
    main()
