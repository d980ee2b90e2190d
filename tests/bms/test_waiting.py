"""What is said on standard error while a command works."""

from __future__ import annotations

import io
import json
import os
import pty
import subprocess
import sys

import pytest

from bms.progress import part
from bms.waiting import waiting


class Clock:
    """Time in s that passes when it is told to."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def lines_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_nothing_is_said_of_what_takes_less_than_ten_seconds(clock, capsys):
    with waiting("counting", 4, "parts", clock_s=clock) as wait:
        for _ in range(4):
            clock.now_s += 2.49
            wait.advance()
    assert lines_of(capsys) == []


def test_from_ten_seconds_on_a_line_says_what_is_done_and_how_far_it_is(clock, capsys):
    with waiting("counting", 4, "parts", clock_s=clock) as wait:
        clock.now_s += 10.0
        wait.advance()
    assert lines_of(capsys) == ["bms: counting: 1 of 4 parts, 10 s"]


def test_without_a_unit_it_is_per_cent(clock, capsys):
    with waiting("training", completed=0.25, clock_s=clock) as wait:
        clock.now_s += 12.4
        wait.reach(0.5)
        clock.now_s += 10.0
        wait.advance(0.125)
    assert lines_of(capsys) == ["bms: training: 50 %, 12 s", "bms: training: 62 %, 22 s"]


def test_an_hour_of_steps_is_a_handful_of_lines(clock, capsys):
    with waiting("charging", 36_000, "runs", clock_s=clock) as wait:
        for _ in range(36_000):
            clock.now_s += 0.1
            wait.advance()
    seconds = [float(line.split()[-2]) for line in lines_of(capsys)]
    assert seconds == [10, 20, 40, 80, 160, 320, 640, 1280, 2560]


def test_after_a_step_of_a_minute_one_line_stands_for_those_that_it_passed(clock, capsys):
    with waiting("counting", 4, "parts", clock_s=clock) as wait:
        clock.now_s += 60.0
        wait.advance()
        clock.now_s += 19.0
        wait.advance()
        clock.now_s += 1.0
        wait.advance()
    assert [line.split(": ")[-1] for line in lines_of(capsys)] == [
        "1 of 4 parts, 60 s",
        "3 of 4 parts, 80 s",
    ]


def test_what_is_begun_completes_what_was_begun_before(clock, capsys):
    with waiting("comparing", 2, "parts", clock_s=clock) as wait:
        wait.begin("filters")
        clock.now_s += 15.0
        wait.begin("perceptron")
    assert lines_of(capsys) == ["bms: perceptron: 1 of 2 parts, 15 s"]


def test_on_a_terminal_it_is_a_bar_that_is_gone_in_the_end(monkeypatch, capsys):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with waiting("charging", 7, "runs", completed=2) as wait:
        wait.advance(3)
    text = terminal.getvalue()
    assert "charging" in text
    assert "5 of 7 runs" in text
    erased_line = "\x1b[2K"
    assert text.rindex(erased_line) > text.rindex("runs")
    assert capsys.readouterr().out == ""


def test_a_terminal_that_cannot_erase_gets_lines(monkeypatch, clock):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "dumb")
    with waiting("charging", 7, "runs", clock_s=clock) as wait:
        clock.now_s += 11.0
        wait.advance()
    assert terminal.getvalue() == "bms: charging: 1 of 7 runs, 11 s\n"


def test_an_exception_passes_and_takes_the_bar_with_it(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with pytest.raises(KeyboardInterrupt), waiting("charging"):
        raise KeyboardInterrupt


def test_a_part_of_a_computation_has_its_share_of_the_whole():
    seen: list[float] = []
    half = part(part(seen.append, 0.0, 0.5), 0.2, 1.0)
    half(0.0)
    half(1.0)
    assert seen == pytest.approx([0.1, 0.5])


def on_terminal(*arguments: str) -> tuple[str, str]:
    """Standard output of a command, and what its standard error shows on a terminal."""
    near, far = pty.openpty()
    command = [sys.executable, "-c", "from bms.cli import main; main()", *arguments]
    environment = {**os.environ, "TERM": "xterm"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=far, env=environment) as process:
        os.close(far)
        shown = b""
        try:
            while piece := os.read(near, 1 << 16):
                shown += piece
        except OSError:  # how Linux says that nobody has the other end open
            pass
        assert process.stdout is not None
        out = process.stdout.read()
    os.close(near)
    assert process.returncode in (0, 1)  # 1: time ends before the charge
    return out.decode(), shown.decode()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("sil", "--max-time-s", "5", "--json"), "kan-rcbf-fastest, state of charge"),
        (("campaign", "--runs", "2", "--max-time-s", "5", "--json"), "of 2 runs"),
    ],
    ids=["sil", "campaign"],
)
def test_a_command_tells_a_terminal_and_leaves_its_output_to_json(
    arguments, told, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    out, shown = on_terminal(*arguments)
    assert told in shown
    assert isinstance(json.loads(out), dict)
