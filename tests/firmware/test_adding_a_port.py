"""A board is added by the steps of docs/ports.md, taken from the page itself."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.ports import ROOT, build, needs_compiler

PAGE = (ROOT / "docs" / "ports.md").read_text(encoding="utf-8")
SECTION = PAGE.split("\n## Adding a port\n")[1].split("\n## ")[0]
NEW_BOARD = "mps2_an500"


def steps() -> list[str]:
    """The numbered steps with the code blocks that belong to them."""
    return re.split(r"^\d\. ", SECTION, flags=re.MULTILINE)[1:]


def block(step: str, language: str) -> str:
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", step, re.DOTALL | re.MULTILINE)
    return str(text)


def run(tree: Path, *command: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    done = subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project in which the page's steps have been followed, up to its commands."""
    tree = tmp_path_factory.mktemp("port") / "tree"
    for folder in ("bms", "codegen", "hil_sim", "firmware_c"):
        shutil.copytree(
            ROOT / folder, tree / folder, ignore=shutil.ignore_patterns("__pycache__", "build")
        )
    shutil.copy(ROOT / "Makefile", tree)
    first, second, third = steps()
    (path,) = re.findall(r"`(firmware_c/port/[^`]+/port\.mk)`", first)
    (tree / path).parent.mkdir()
    (tree / path).write_text(block(first, "make"), encoding="utf-8")
    patch = subprocess.run(
        ["patch", "-p1", "--no-backup-if-mismatch"],
        cwd=tree,
        input=block(second, "diff"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert patch.returncode == 0, patch.stdout
    (path,) = re.findall(r"at the end of `([^`]+)`", third)
    with (tree / path).open("a", encoding="utf-8") as file:
        file.write("\n" + block(third, "toml"))
    return tree


def test_the_page_has_three_steps() -> None:
    assert len(steps()) == 3


@needs_compiler
@pytest.mark.slow
def test_board_added_by_the_pages_steps_builds_and_is_flashed(tree: Path) -> None:
    make, flash = (shlex.split(line) for line in block(steps()[2], "sh").splitlines())
    assert make == ["make", "firmware", f"TARGET={NEW_BOARD}", "ACCEPT=1"]
    # What the Makefile does with these words, without an environment of its own.
    run(
        tree, "make", "-f", f"firmware_c/port/{NEW_BOARD}/port.mk", f"PYTHON={sys.executable}",
        "ACCEPT=1",
    )  # fmt: skip
    assert NEW_BOARD in json.dumps(json.loads((tree / "firmware_c/figures.json").read_text()))
    run(tree, "make", "-f", f"firmware_c/port/{NEW_BOARD}/port.mk", f"PYTHON={sys.executable}")

    program, *words = flash
    assert program == "bms"
    said = run(tree, sys.executable, "-c", "from bms.cli import main; main()", *words)

    assert "mps2-an500.bin: firmware version" in said


@needs_compiler
@pytest.mark.slow
def test_default_board_of_flash_does_not_change_with_a_new_one(tree: Path) -> None:
    image = build("mps2_an386") / "firmware.bin"

    said = run(
        tree, sys.executable, "-c", "from bms.cli import main; main()", "flash", "--no-start",
        "--image", str(image),
    )  # fmt: skip

    assert "mps2-an386.bin: firmware version" in said
