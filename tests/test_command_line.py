"""The list of commands: what it says, and what it costs."""

from __future__ import annotations

import os
import sys
from importlib.metadata import EntryPoint, entry_points
from inspect import getdoc

import pytest

from bms.cli import docstring

ALLOWED_CPU_S = 0.5
COMMANDS = sorted(entry_points(group="bms.commands"), key=lambda entry: entry.name)
HELP = "import sys; sys.argv = ['bms', '--help']; from bms.cli import main; main()"
HEAVY = ("numpy", "scipy", "matplotlib", "cantools", "can", "pydantic")


def run_python(code: str) -> tuple[int, float]:
    """Exit code and CPU seconds of a new interpreter, whose output nobody wants."""
    actions = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    command = [sys.executable, "-c", code]
    pid = os.posix_spawn(sys.executable, command, os.environ, file_actions=actions)
    _, status, usage = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime


@pytest.mark.parametrize("entry", COMMANDS, ids=lambda entry: entry.name)
def test_the_list_shows_what_the_command_says_of_itself(entry: EntryPoint) -> None:
    assert docstring(entry) == getdoc(entry.load())
    assert docstring(entry)


def test_a_command_without_source_is_imported_for_what_it_says() -> None:
    entry = EntryPoint("square-root", "math:sqrt", "bms.commands")
    assert docstring(entry) == "Return the square root of x."


def test_every_command_is_in_the_list(bms) -> None:
    code, out, _ = bms("--help")
    assert code == 0
    for entry in COMMANDS:
        assert f" {entry.name} " in out
    assert "Certify that no decision lets a limit be crossed" in out


def test_the_list_needs_none_of_what_the_commands_work_with() -> None:
    check = "import atexit, os, sys\n"
    check += f"atexit.register(lambda: os._exit(any(m in sys.modules for m in {HEAVY})))\n"
    assert run_python(check + HELP)[0] == 0
    assert run_python(check + "import numpy")[0] == 1


def test_the_list_comes_in_half_a_second_of_processor_time() -> None:
    # The least of three: a busy machine adds to each.
    assert min(run_python(HELP)[1] for _ in range(3)) < ALLOWED_CPU_S


def test_a_command_is_suggested_for_one_that_is_not_there(bms) -> None:
    code, _, err = bms("sli")
    assert code == 2
    assert err == "bms: No such command 'sli'. Did you mean 'sil'?; see 'bms --help'\n"
