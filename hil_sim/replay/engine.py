"""Feeding of a recording to an ECU, in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hil_sim.bus.buses import Frame
from hil_sim.logs import LogFrame, LogWriter
from hil_sim.nodes.ecu import EcuLike
from hil_sim.replay.recording import Answer, Recording


def replay(recording: Recording, ecu: EcuLike) -> list[Answer]:
    """What a freshly started ECU answers, by period, to the frames that another one got."""
    answers = []
    for period in recording.periods:
        for frame in period.received:
            ecu.receive(frame.frame_id, frame.data)
        ecu.step()
        answers.append(tuple(Frame(*frame) for frame in ecu.transmit()))
    return answers


def write_replayed(path: Path, recording: Recording, answers: Sequence[Answer]) -> None:
    """Write the log with other answers in the place and at the time of the recorded ones.

    Raises InputError as LogWriter does.
    """
    with LogWriter(path) as writer:
        for period, answer in zip(recording.periods, answers):
            for received in period.received:
                writer.write(received)
            for frame in answer:
                writer.write(LogFrame(period.answer_time_s, frame.frame_id, frame.data))
