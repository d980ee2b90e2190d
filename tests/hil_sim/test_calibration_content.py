"""What host commands make of an ECU whose calibration is not what its model and preset make."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bms.errors import ModelMismatchError
from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.image import calibration_content, shipped_contents
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.buses import Frame
from hil_sim.bus.database import load_codecs
from hil_sim.logs.recorder import Recorder
from hil_sim.monitor import blocks
from hil_sim.monitor.model import SystemModel
from hil_sim.monitor.presets import PresetInForce
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

CODECS = load_codecs()
PRESET, MODEL = load_pair(DEFAULT_PRESET, None)
WRONG = "not what its model and preset make"
OTHER_CURRENT_A = -20.0  # the genuine calibration has another reference current


def edited_ecu() -> Ecu:
    """Model and preset by hash are the genuine ones; one number is another."""
    return Ecu(DEFAULT_PRESET, changes={"reference_current_A": OTHER_CURRENT_A})


def test_the_ecu_computes_what_the_host_expects() -> None:
    block = ffi.addressof(lib.host_default_calibration()[0])
    assert lib.content_of_calibration(block) == calibration_content(PRESET, MODEL)


def test_a_run_with_an_edited_calibration_is_refused() -> None:
    settings = Settings(PRESET, max_time_s=1.0)
    with pytest.raises(ModelMismatchError, match=WRONG) as refusal:
        run_both(settings, ecu_factory=lambda plant, database: edited_ecu())
    assert "\n" not in str(refusal.value)


def first_answer(ecu: Ecu) -> SystemModel:
    ecu.step()
    system = SystemModel(CODECS)
    for frame_id, data in ecu.transmit():
        system.take(0.0, Frame(frame_id, data))
    return system


def test_the_monitor_says_so_in_one_line() -> None:
    shipped_contents()
    shown = blocks.identity(first_answer(edited_ecu()).snapshot(0.0), PresetInForce(PRESET))
    assert WRONG in shown.plain and len(shown.plain.splitlines()) == 2
    genuine = first_answer(Ecu(DEFAULT_PRESET)).snapshot(0.0)
    assert len(blocks.identity(genuine, PresetInForce(PRESET)).plain.splitlines()) == 1


def test_the_monitor_says_that_the_ecu_restarted() -> None:
    ecu = Ecu(DEFAULT_PRESET)
    start = {"calibration_content": 2**32 - 1, "reset_cause": 2, "reset_count": 2}
    lib.bms_tell_start(ecu._state, ffi.new("bms_start_t *", start))
    shown = blocks.identity(first_answer(ecu).snapshot(0.0), PresetInForce(PRESET)).plain
    assert "restarted, 2 in a row: Watchdog" in shown and WRONG not in shown


def test_replay_says_what_the_recorded_ecu_ran_on(bms: Any, tmp_path: Path) -> None:
    log = tmp_path / "genuine.log"
    with Recorder(log) as recorder:
        run_both(Settings(PRESET, max_time_s=1.0), recorder)
    assert bms("replay", log)[0] == 0
    text, start = log.read_text(), CODECS["Start"]
    lines = [line for line in text.splitlines() if f" {start.frame_id:03X}#" in line]
    assert lines, "the ECU has said nothing of its start"
    forged = tmp_path / "edited.log"
    answer = start_frames(edited_ecu())
    for number, line in enumerate(lines):
        head = line.partition("#")[0]
        text = text.replace(line, f"{head}#{answer[number].hex().upper()}")
    forged.write_text(text)
    code, out, _ = bms("replay", forged)
    assert code == 1 and WRONG in " ".join(out.split())


def start_frames(ecu: Ecu) -> list[bytes]:
    """Its first Start frames."""
    found = []
    for _ in range(30):
        ecu.step()
        found += [data for frame_id, data in ecu.transmit() if frame_id == CODECS["Start"].frame_id]
    return found
