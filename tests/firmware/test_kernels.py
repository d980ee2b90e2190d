"""The shortcuts of the firmware's kernels change no bit of any answer, on no shipped calibration.

`python -m tests.firmware.native.kernels` tries 30 million states; here are some of them.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.firmware.native.build import ROOT, build_program
from tests.firmware.native.kernels import compare, shipped_blocks

STATES = 100_000
KERNELS = {
    *("estimate", "decision", "open_circuit_voltage"),
    *("checksum", "family_table", "family_decision"),
}
DECIDED_BY = ("none", "voltage", "soc", "core", "surface", "infeasible", "invalid")
BLOCKS = dict(shipped_blocks())
SHORTCUTS_TOO_SHORT = (
    ("kan.c", "while (x < knot[0])", "while (x <= knot[0])"),
    ("rcbf.c", "if (is_open && (value_at(lower, u) > enough))", "if (is_open)"),
    ("rcbf.c", "(clamped <= start[1])", "(clamped <= start[1] + 1e-3f)"),
    ("e2e.c", "0x00u, 0x2Fu, 0x5Eu", "0x00u, 0x2Fu, 0x5Fu"),
    ("family_tables.c", "is_known = cells[i] < greatest;", "is_known = true;"),
    ("family_decision.c", "!(left_at_W >= 0.0f)", "!(left_at_W >= -0.01f)"),
)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_program("kernels", tmp_path_factory.mktemp("kernels"), sanitize=True)


def test_every_model_that_ships_is_compared() -> None:
    models = {path.stem for path in (ROOT / "bms" / "models").glob("*.json")}
    assert set(BLOCKS) == models
    assert len(models) >= 7


@pytest.mark.parametrize("name", BLOCKS)
def test_no_bit_differs_from_the_plain_forms(program: Path, name: str) -> None:
    said, first = compare(program, BLOCKS[name], STATES, seed=1)
    assert said["differing"] == dict.fromkeys(KERNELS, 0), first
    assert said["states"] == STATES
    # Of the box and of what lies outside, and of all that can decide.
    assert 0.02 * STATES < said["in_domain"] < 0.9 * STATES
    decided_by = dict(zip(DECIDED_BY, said["decided_by"]))
    for reason in ("none", "voltage", "core", "infeasible", "invalid"):
        assert decided_by[reason] > 0.005 * STATES, decided_by


def test_the_surface_and_the_state_of_charge_decide_somewhere(program: Path) -> None:
    said, _ = compare(program, BLOCKS["lin2014"], STATES, seed=2)
    decided_by = dict(zip(DECIDED_BY, said["decided_by"]))
    assert min(decided_by.values()) > 0.01 * STATES


@pytest.mark.parametrize("name", ["a123_26650", "a123_26650_10C", "samsung_30q"])
def test_a_family_s_decision_needs_no_solution_where_its_condition_holds(
    program: Path, name: str
) -> None:
    """Where the entropic heat cools, a solution from 0 A up may leave out what fulfils it."""
    said, _ = compare(program, BLOCKS[name], STATES, seed=3)
    none, voltage, _, core, *_, mapped, unknown = said["family_decided_by"]
    assert min(none, voltage, core, mapped, unknown) > 0.02 * STATES
    assert said["family_stronger"] < 0.001 * STATES
    assert said["differing"]["family_decision"] == 0


def test_a_shortcut_that_is_too_short_is_found_in_every_kernel(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "firmware_c", tmp_path / "firmware_c")
    for name, right, wrong in SHORTCUTS_TOO_SHORT:
        source = tmp_path / "firmware_c" / "src" / name
        text = source.read_text(encoding="utf-8")
        assert text.count(right) == 1, name
        source.write_text(text.replace(right, wrong), encoding="utf-8")
    program = build_program("kernels", tmp_path / "build", sanitize=False, tree=tmp_path)
    said, first = compare(program, BLOCKS["a123_26650_10C"], STATES, seed=1)
    assert set(said["differing"]) == KERNELS
    assert all(count > 0 for count in said["differing"].values()), said
    for kernel in KERNELS:
        assert f"kernels: {kernel} differs at" in first


def test_a_block_that_the_firmware_refuses_is_not_compared(program: Path) -> None:
    with pytest.raises(RuntimeError, match="no valid calibration"):
        compare(program, BLOCKS["lin2014"][:100], 10, seed=1)
