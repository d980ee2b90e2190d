"""Whether a recorded ECU ran on what the model and preset that it named make.

Apart from `identity`, since it needs the firmware, which a build must not find loaded already.
"""

from __future__ import annotations

from bms.image import UNKNOWN_CONTENT, calibration_content, content_text
from bms.model.model_file import KanModel
from bms.presets import Preset
from hil_sim.replay.identity import is_of_pair
from hil_sim.replay.recording import Recording
from hil_sim.replay.versions import first_content


def foreign_content_of(recording: Recording, preset: Preset, model: KanModel) -> str | None:
    """What is wrong with the calibration of a recorded ECU that names this preset and model.

    None where its content is theirs, or where it does not tell.
    """
    if not is_of_pair(recording, preset, model):
        return None
    frames = (frame for answer in recording.answers for frame in answer)
    content = first_content(frames, recording.database)
    expected = calibration_content(preset, model)
    if content in (None, UNKNOWN_CONTENT, expected):
        return None
    return content_text(content, expected)
