"""A pack's period costs what its cells cost: within the budgets, and linear."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bms.errors import InputError
from hil_sim.studies.pack.cost import host_bytes, instructions

ROOT = Path(__file__).parents[2]
HAS_TOOLS = shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")
LARGE, MOST_BYTES, MOST_INSTRUCTIONS = 96, 16 * 1024, 200_000


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    if not (HAS_TOOLS or "CI" in os.environ):
        pytest.skip("not run: needs gcc-arm-none-eabi and qemu-system-arm")
    folder = tmp_path_factory.mktemp("pack_cost")
    program = folder / "pack_cost.elf"
    make = ["make", "-s", "-f", "firmware_c/pack_cost/pack_cost.mk", f"BUILD={folder}"]
    done = subprocess.run(
        [*make, f"PYTHON={sys.executable}", str(program)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return instructions(program)


def test_96_cells_fit_into_instructions_and_ram_of_the_board(counted):
    large = [one for one in counted if one.cells == LARGE]
    assert {one.is_rising for one in large} == {True, False}
    assert all(one.periods > 50 for one in counted)
    assert max(one.most for one in large) <= MOST_INSTRUCTIONS
    assert large[0].pack_bytes <= MOST_BYTES


def test_instructions_are_linear_in_the_cells(counted):
    most = {one.cells: one.most for one in counted if one.is_rising}
    assert sorted(most) == [1, 4, 16, 96, 192]
    per_cell = [(most[b] - most[a]) / (b - a) for a, b in ((1, 4), (4, 16), (16, 96), (96, 192))]
    assert max(per_cell) <= 1.05 * min(per_cell)


def test_a_cell_that_does_not_govern_costs_less_than_one_that_moves_the_current(counted):
    of = {(one.cells, one.is_rising): one for one in counted}
    assert of[LARGE, False].most < of[LARGE, True].most


def test_a_program_that_is_not_built_is_refused_with_the_command_that_builds_it(tmp_path):
    with pytest.raises(InputError, match=r"not built; run 'make -f firmware_c/pack_cost"):
        instructions(tmp_path / "none.elf")


def test_ram_of_a_pack_on_the_host():
    assert host_bytes(LARGE, has_family=False) <= MOST_BYTES
    assert host_bytes(LARGE, has_family=True) > MOST_BYTES  # docs/pack.md says so
