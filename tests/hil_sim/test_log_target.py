"""libFuzzer reaches the branches of the readers of logs, by rules that a broken reader breaks."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_sim.logs import reader
from tests.hil_sim.log_target import SUFFIXES, broken_rules, inputs_to_begin_with
from tests.hil_sim.test_fuzz_logs import Crashes, ForgetsRemoteFrames

ROOT = Path(__file__).parents[2]
HAS_ATHERIS = importlib.util.find_spec("atheris") is not None


def test_a_log_of_each_dialect_keeps_the_rules(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inputs = inputs_to_begin_with(tmp_path)
    assert {SUFFIXES[data[0]] for data in inputs.values()} == set(SUFFIXES)
    for name, data in inputs.items():
        assert broken_rules(SUFFIXES[data[0]], data[1:], tmp_path) == [], name


@pytest.mark.parametrize("broken", [ForgetsRemoteFrames, Crashes])
def test_a_broken_reader_breaks_them(tmp_path, monkeypatch, broken):
    monkeypatch.chdir(tmp_path)
    logs = [d[1:] for d in inputs_to_begin_with(tmp_path).values() if SUFFIXES[d[0]] == ".log"]
    monkeypatch.setattr(reader, "_PARSERS", {**reader._PARSERS, ".log": broken})
    inputs = [log + end for log in logs for end in (b"", b"no entry\n")]
    assert any(broken_rules(".log", content, tmp_path) for content in inputs)


@pytest.mark.slow
@pytest.mark.skipif(
    not HAS_ATHERIS and "CI" not in os.environ, reason="not run: atheris is not installed"
)
def test_libfuzzer_finds_its_way_and_no_rule_is_broken(tmp_path):
    words = ["-m", "tests.hil_sim.log_target", "kept", "-runs=1000", "-seed=20261127"]
    done = subprocess.run(
        [sys.executable, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    covered = [int(number) for number in re.findall(r" cov: (\d+) ", done.stderr)]
    assert covered[-1] >= covered[0] > 100  # readers without counters of branches have none
    assert len(list((tmp_path / "kept").iterdir())) > len(inputs_to_begin_with(tmp_path))
