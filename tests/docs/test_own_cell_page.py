"""The command of docs/your-own-cell.md on the recordings that it names, where they are."""

from __future__ import annotations

import json
import re
import shlex

import pytest

from bms.presets import load_preset
from hil_sim.commands import cell as command
from tests.docs.pages import ROOT

DATA = ROOT.parent / "shared" / "data"
TEXT = (ROOT / "docs" / "your-own-cell.md").read_text(encoding="utf-8")
RECORDING = re.compile(r"samsung_30q_\w+\.csv")


def words_on_the_page() -> list[str]:
    (block,) = re.findall(r"^    (bms cell samsung(?:.*\\\n)*.*)", TEXT, re.MULTILINE)
    return shlex.split(block.replace("\\\n", " "))


@pytest.mark.slow
def test_the_command_of_the_page_identifies_the_cell_within_the_goals(bms, tmp_path, monkeypatch):
    """Its first step alone; training, faults and image take minutes."""
    words = words_on_the_page()[1:]
    if any(not (DATA / word).is_file() for word in words if RECORDING.fullmatch(word)):
        pytest.skip(f"not run: the recordings of the Samsung 30Q are not in {DATA}")
    words = [str(DATA / word) if RECORDING.fullmatch(word) else word for word in words]
    words[words.index("--out") + 1] = str(tmp_path / "samsung_30q")
    monkeypatch.setattr(command, "steps_after_preset", lambda choices: ())

    code, out, err = bms(*words, "--json")

    assert code == 0, err
    (step,) = json.loads(out)["steps"]
    told = re.search(
        r"voltage RMSE ([\d.]+) mV.* surface RMSE ([\d.]+) K; intervals cover ([\d.]+) % of the "
        r"voltages and ([\d.]+) %",
        step["said"],
    )
    assert told is not None, step["said"]
    voltage_mV, surface_K, *covered = map(float, told.groups())
    assert voltage_mV <= 25.0
    assert surface_K <= 0.6
    assert min(covered) >= 95.0
    assert all((tmp_path / "samsung_30q" / name).is_file() for name in step["files"])
    preset = load_preset(tmp_path / "samsung_30q" / "preset.toml")
    assert preset.name == "samsung_30q"
    assert preset.limits.reference_current_A == -4.0


def test_every_step_stands_on_the_page() -> None:
    on_the_page = set(re.findall(r"^\| `(\w+)` \|", TEXT, re.MULTILINE))
    steps = command.steps_after_preset(command.Choices(0, 1))
    assert on_the_page == {"identify", "preset", *(step.name for step in steps)}
