"""Instructions on an emulated board: counted exactly, repeatably, and within the budget."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bms.errors import InputError
from bms.firmware.calibration import calibration_bytes
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from hil_sim.bus.buses import Frame
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from hil_sim.studies.bench.limits import period_breakdown
from hil_sim.studies.cost.by_function import instructions_by_function
from hil_sim.studies.cost.charges import charge_records
from hil_sim.studies.cost.counting import count
from hil_sim.studies.cost.measure import CostReport, measure_cost
from hil_sim.studies.cost.records import State, counts, period, restart, state

ROOT = Path(__file__).parents[2]
FPU = "mps2-an386"
HAS_TOOLS = shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")
pytestmark = pytest.mark.skipif(
    not (HAS_TOOLS or "CI" in os.environ),
    reason="not run: needs gcc-arm-none-eabi and qemu-system-arm; see tools/debian_packages.sh",
)
BUDGET, FAMILY_BUDGET = 1150, 1650
WARM = State(-20.0, 0.8, 312.0, 303.0, 315.0, 0.4, -23.0)


def build(folder: Path, board: str, root: Path = ROOT) -> Path:
    """The counting program of a board."""
    name = board.replace("-", "_")
    program = folder / "cost.elf"
    make = ["make", "-s", "-f", f"firmware_c/port/{name}/port.mk", f"BUILD={folder}"]
    done = subprocess.run(
        [*make, f"PYTHON={sys.executable}", str(program)],
        cwd=root, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    return build(tmp_path_factory.mktemp("cost"), FPU)


def test_a_thousand_instructions_count_as_a_thousand(tmp_path):
    shutil.copytree(ROOT / "firmware_c", tmp_path / "firmware_c")
    source = tmp_path / "firmware_c" / "cost" / "cost.c"
    text = source.read_text()
    start = text.index("    cost->result = kan_evaluate")
    end = text.index(";", start) + 1
    nops = '    (void)cost;\n    __asm__ volatile(".rept 1000\\n nop\\n .endr");'
    source.write_text(text[:start] + nops + text[end:])
    counted = count(build(tmp_path / "build", FPU, tmp_path), FPU, [state(WARM)])
    # The empty work stores a result, which takes an instruction or two.
    assert abs(int(counted.estimate[0]) - 1000) <= 3
    assert counted.decision[0] > 100


def test_a_program_that_does_not_end_is_told(program):
    with pytest.raises(InputError, match=r"cost\.elf: has not ended on mps2-an386 in 0\.01 s"):
        count(program, FPU, [state(WARM)] * 1000, timeout_s=0.01)


def test_counts_are_repeatable_and_belong_to_their_record(program):
    cold = WARM._replace(surface_temperature_K=280.0, core_temperature_K=500.0)
    alone = [count(program, FPU, [state(one)]) for one in (WARM, cold)]
    together = count(program, FPU, [state(WARM), restart(), state(cold), state(WARM)])
    for kind in ("estimate", "decision"):
        first, second = (int(getattr(counted, kind)[0]) for counted in alone)
        assert getattr(together, kind).tolist() == [first, second, first]
    # A core of 500 K is refused before anything is solved: what else the state holds, on which the
    # effort of a solution depends, makes no difference.
    other = WARM._replace(core_temperature_K=500.0, reference_current_A=-1.0)
    refused = count(program, FPU, [state(cold), state(other)]).decision.tolist()
    valid = [WARM, WARM._replace(surface_temperature_K=285.0, core_temperature_K=286.0)]
    solved = count(program, FPU, [state(one) for one in valid]).decision.tolist()
    assert refused[0] == refused[1] < min(solved)
    assert solved[0] != solved[1]
    assert together.period.tolist() == [0, 0, 0]


@pytest.fixture(scope="module")
def report(program) -> CostReport:
    return measure_cost(program, FPU, load_preset("paper_calibrated"), 1, 10, 1000)


def test_estimate_and_decision_stay_within_the_budget_everywhere_the_search_goes(report):
    both, whole = report.costs["estimate_and_decision"], report.costs["control_period"]
    assert both.worst <= BUDGET
    assert both.charge_minimum <= both.charge_median <= both.charge_worst <= both.worst
    assert both.worst <= report.costs["estimate"].worst + report.costs["decision"].worst
    assert whole.charge_minimum > both.charge_worst
    preset = load_preset("paper_calibrated")
    charge_s = np.count_nonzero(report.charging) * preset.timing.sampling_period_s
    assert charge_s == pytest.approx(run_both(Settings(preset)).summary.charge_time_s, abs=1.0)


def test_functions_of_a_period_add_up_to_what_is_counted_of_it(program, report):
    records = charge_records(Settings(load_preset("paper_calibrated"), max_time_s=2.0)).records
    found = instructions_by_function(program, FPU, records, 5)
    # The call itself is not counted.
    assert sum(found.values()) == pytest.approx(
        count(program, FPU, records).period[-5:].mean(), abs=10.0
    )
    assert found["kan_evaluate"] <= report.costs["estimate"].charge_worst
    assert list(found.values()) == sorted(found.values(), reverse=True)


def test_figures_of_a_charge_are_those_of_its_first_decision_to_its_last(report):
    whole, decided = report.series["control_period"], np.flatnonzero(report.charging)
    assert 0 < decided[0] < decided[-1] < len(whole) - 1
    assert np.all(np.diff(decided) == 1)
    # A period without a decision costs less, whatever else it holds.
    assert whole[~report.charging].max() < report.costs["control_period"].charge_minimum
    both = report.series["estimate_and_decision"]
    assert np.all(whole[decided] > both[decided])


def test_a_family_is_counted_with_its_observation_and_a_broken_block_is_refused(program, report):
    preset = load_preset("a123_26650_10C")
    block = calibration_bytes(preset, load_shipped_model(preset.name))
    records = charge_records(Settings(preset, max_time_s=20.0)).records
    counted = count(program, FPU, records, calibration=block)
    deciding = counted.decision > np.median(counted.decision) / 2
    assert counted.observation[deciding].min() > 100
    assert counted.together[deciding].max() <= FAMILY_BUDGET
    assert np.all(counted.period[deciding] > counted.together[deciding])
    # Of the compiled-in single cell there is none.
    assert report.series["observation"].max() == 0
    with pytest.raises(InputError, match="ended with status 1"):
        count(program, FPU, records, calibration=block[:-4])


def test_the_command_prints_every_figure_and_fails_beyond_its_limit(
    bms, program, tmp_path, monkeypatch
):
    folder = tmp_path / "build" / "firmware" / "mps2_an386"
    folder.mkdir(parents=True)
    shutil.copy(program, folder)
    monkeypatch.chdir(tmp_path)
    run = ("cost", "--target", f"qemu:{FPU}", "--charges", "1", "--states", "50", "--json")
    status, output, errors = bms(*run, "--out", "cost.png", "--limit", "100")
    assert status == 1
    assert "instructions, allowed 100" in errors
    figures = json.loads(output)[0]
    assert (figures["board"], figures["unit"]) == (FPU, "instructions")
    assert figures["estimate"]["worst"] > 100
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")


def test_wrong_use_is_one_line(bms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    for arguments, words in (
        (("--target", "mps2-an386"), "choose one of qemu:mps2-an386, qemu:mps2-an385"),
        (("--target", "qemu:virt"), "choose one of qemu:mps2-an386, qemu:mps2-an385"),
        (("--target", f"qemu:{FPU}"), "run 'make cost'"),
        (("--out", "file/cost.png"), "file: cannot be written"),
        (("--out", "."), "is a directory"),
    ):
        status, _, errors = bms("cost", *arguments)
        assert status == 2
        assert words in errors
        assert errors.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_records_hold_exactly_the_frames_of_a_period():
    frames = [Frame(0x100 + i, bytes(8)) for i in range(5)]
    for number in range(6):
        assert len(period(frames[:number])) == len(period([]))
        assert struct.unpack_from("<II", period(frames[:number]))[1] == number
    with pytest.raises(ValueError, match="at most 5 frames, not 6"):
        period([*frames, frames[0]])


def test_ticks_of_the_timer_become_instructions():
    ticks = b"".join(n.to_bytes(4, "little") for n in (10, 26, 10, 1610, 10))
    assert [values.tolist() for values in counts(ticks)] == [[10], [0], [1000], [0]]


def test_the_command_prints_the_aims_and_what_a_period_is_made_of(
    bms, program, tmp_path, monkeypatch
):
    """The groups of functions leave little, so that the reader can judge the whole."""
    folder = tmp_path / "build" / "firmware" / "mps2_an386"
    folder.mkdir(parents=True)
    shutil.copy(program, folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    status, output, _ = bms("cost", "--target", f"qemu:{FPU}", "--charges", "1", "--states", "50")
    assert status == 0
    for aim in (
        "estimate and decision, worst of a charge on mps2-an386",
        "control period with frames, median on mps2-an386",
        "flash of the application on mps2-an386",
        "flash of the image on mps2-an386",
    ):
        assert aim in output
    counts = instructions_by_function(
        program, FPU, charge_records(Settings(load_preset("paper_calibrated"))).records[:182], 12
    )
    made = period_breakdown(FPU, counts, 4000.0)
    assert made.total == pytest.approx(sum(counts.values()))
    assert abs(made.parts["rest"]) < 0.05 * made.total
    assert f"{made.total:,.0f}" in output
