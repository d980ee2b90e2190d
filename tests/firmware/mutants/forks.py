"""Runs tests on another build of the firmware, each time in a fork of one loaded process.

An interpreter that starts anew for each build takes longer to load what the tests need than most
tests take.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import pytest

from bms.native_build import ROOT
from tests.firmware.mutants.run import HEAVY, PROFILE, register_profile

_MYSELF = "tests.firmware.mutants.forks"


class Outcome(NamedTuple):
    """Exit code of pytest (1: tests failed) and what it printed."""

    code: int | None
    output: str


def run_tests(build: Path, arguments: Sequence[str], out: Path) -> Outcome:
    """Run pytest with the firmware of a build folder; what it prints is kept in file `out`."""
    context = get_context("forkserver")
    context.set_forkserver_preload([*HEAVY, _MYSELF])
    child = context.Process(target=_run, args=(build, list(arguments), out))
    child.start()
    child.join()
    return Outcome(child.exitcode, out.read_text(encoding="utf-8"))


def _run(build: Path, arguments: Sequence[str], out: Path) -> None:
    os.chdir(ROOT)
    with out.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    register_profile()
    options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--hypothesis-profile={PROFILE}"]
    code = pytest.main([*options, "--firmware-build", str(build), *arguments])
    os._exit(int(code))
