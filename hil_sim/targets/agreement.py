"""One firmware on several targets: whether each answers a recording byte for byte as the host did.

The plant knows nothing of an ECU but its answers. A target that answers the recorded frames as the
host did would therefore have got these frames in closed loop too, period by period.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from bms.errors import BusError
from hil_sim.bus.buses import Frame
from hil_sim.replay.comparison import Comparison, compare
from hil_sim.replay.recording import Answer
from hil_sim.replay.signals import Signals
from hil_sim.targets.catalog import Target
from hil_sim.targets.scenarios import Scenario


@dataclass(frozen=True)
class FrameDifference:
    """A frame of the first period in which two sides differ; None on the side that lacks it."""

    frame_id: int
    message: str
    host: bytes | None
    target: bytes | None


@dataclass(frozen=True)
class Agreement:
    """How a target's answers compare with those of the host in one scenario."""

    target: str
    scenario: Scenario
    comparison: Comparison
    frames: tuple[FrameDifference, ...]
    """Of the first period that differs."""


def agreements_with_host(
    targets: Sequence[Target],
    scenarios: Sequence[Scenario],
    played: Callable[[], None] = lambda: None,
) -> list[list[Agreement]]:
    """Agreements by target, then by scenario; the targets run side by side.

    `played` is called after each scenario on each target. Raises InputError or BusError.
    """
    with ThreadPoolExecutor(len(targets)) as pool:
        return list(pool.map(lambda target: _on_target(target, scenarios, played), targets))


def _on_target(
    target: Target, scenarios: Sequence[Scenario], played: Callable[[], None]
) -> list[Agreement]:
    agreements = []
    answers = target.replay([scenario.recording for scenario in scenarios])
    for scenario, said in zip(scenarios, answers):
        count = len(scenario.recording.periods)
        if len(said) != count:
            raise BusError(
                f"target '{target.name}': answered {len(said)} of {count} periods of "
                f"{scenario.name}; build it anew"
            )
        agreements.append(_agreement(target.name, scenario, said))
        played()
    if len(agreements) != len(scenarios):
        raise BusError(
            f"target '{target.name}': played {len(agreements)} of {len(scenarios)} runs; "
            "build it anew"
        )
    return agreements


def _agreement(target: str, scenario: Scenario, said: list[Answer]) -> Agreement:
    recording = scenario.recording
    signals = Signals(recording.database)
    comparison = compare(recording, signals, recording.answers, said)
    frames: tuple[FrameDifference, ...] = ()
    if comparison.first is not None:
        number = comparison.first.period
        frames = _different_frames(signals, recording.answers[number], said[number])
    return Agreement(target, scenario, comparison, frames)


def _different_frames(
    signals: Signals, host: Answer, target: Answer
) -> tuple[FrameDifference, ...]:
    ids = dict.fromkeys(frame.frame_id for frame in (*host, *target))
    pairs = ((n, _data(host, n), _data(target, n)) for n in ids)
    return tuple(
        FrameDifference(n, signals.message(n), one, other)
        for n, one, other in pairs
        if one != other
    )


def _data(answer: Sequence[Frame], frame_id: int) -> bytes | None:
    return next((frame.data for frame in answer if frame.frame_id == frame_id), None)
