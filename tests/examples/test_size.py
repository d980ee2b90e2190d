"""An example is read in one go."""

from __future__ import annotations

from bms.native_build import ROOT


def test_every_file_of_the_examples_has_fewer_than_80_lines() -> None:
    kinds = ("*.c", "*.h", "*.cmake", "*.ld", "*.py", "*.sh", "*.yml", "*.txt", "*.md")
    paths = [path for kind in kinds for path in (ROOT / "examples").rglob(kind)]
    assert {"main.c", "co_simulation.py", "own_plant.py", "own_ecu.py", "workflow.yml"} < {
        path.name for path in paths
    }
    lengths = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in paths}
    assert {name: length for name, length in lengths.items() if length >= 80} == {}
