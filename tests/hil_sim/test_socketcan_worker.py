"""The worker that plays recordings to a native ECU takes answers of an ECU in lock step alone."""

import pytest

from hil_sim.targets import socketcan_worker

RECORDING = [[(0x100, "00"), (0x080, "")]] * 3


class NoBus:
    def recv(self, size, flags):
        raise BlockingIOError


def played(monkeypatch, steps):
    """What is taken when the ECUs that are started make these steps."""
    starts = iter(steps)
    monkeypatch.setattr(
        socketcan_worker,
        "_played",
        lambda *arguments: ([[("answer", n)] for n in range(3)], next(starts)),
    )
    return socketcan_worker._play(["ecu"], NoBus(), RECORDING, 0x180), list(starts)


def test_an_ecu_that_stepped_by_its_own_clock_first_is_started_anew(monkeypatch):
    answers, not_started = played(monkeypatch, [4, 5, 3, 3])
    assert len(answers) == 3
    assert not_started == [3]


def test_an_ecu_that_never_keeps_step_is_an_error(monkeypatch):
    with pytest.raises(SystemExit, match="2 steps in 3 periods"):
        played(monkeypatch, [2] * 20)
