"""A process that replays logs on one build of the firmware; see hil_sim.replay.builds.

    python -m hil_sim.replay.worker [--preset P] [--model M] [--channel C] [--delta-times]
        BUILD OUT LOG...

The extension is put in place before anything imports the installed one. OUT becomes JSON: for each
log the frames of each period.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from bms.errors import BmsError
from bms.native_build import FIRMWARE
from hil_sim.logs import Selection
from hil_sim.replay.engine import replay
from hil_sim.replay.identity import choose_pair
from hil_sim.replay.recording import load_recording
from hil_sim.replay.versions import require_answers_of_version

UNUSABLE = 2
"""Exit code when a build or log cannot be used and stderr says why."""


def main() -> None:
    """Run the process; what is unusable becomes one line on stderr and exit code 2."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("build", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--preset")
    parser.add_argument("--model", type=Path)
    parser.add_argument("--channel")
    parser.add_argument("--delta-times", action="store_true")
    parser.add_argument("logs", type=Path, nargs="+")
    arguments = parser.parse_args()
    try:
        FIRMWARE.load_build(arguments.build)
        selection = Selection(arguments.channel, arguments.delta_times)
        answers = [
            _replay(arguments.build, log, selection, arguments.preset, arguments.model)
            for log in arguments.logs
        ]
    except BmsError as error:
        print(error, file=sys.stderr)
        sys.exit(UNUSABLE)
    arguments.out.write_text(json.dumps(answers), encoding="utf-8")


def _replay(
    build: Path, log: Path, selection: Selection, preset: str | None, model: Path | None
) -> list[list[tuple[int, str]]]:
    from bms.firmware import Ecu  # noqa: PLC0415 (the build has to be in place first)

    recording = load_recording(log, selection)
    answers = replay(recording, Ecu(*choose_pair(recording, preset, model)))
    said = [frame for answer in answers for frame in answer]
    require_answers_of_version(build, said, recording.database)
    return [[(frame.frame_id, frame.data.hex()) for frame in answer] for answer in answers]


if __name__ == "__main__":
    main()
