"""`bms sil --cells`: files, figures and refusals; speed and memory that were asked for."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bms.errors import InputError
from bms.model.pair import load_pair
from hil_sim.bus.frame import Frame
from hil_sim.logs import read_log
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.cost import ecu_instructions
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import lib
from tests.hil_sim.command_line import bms

FIRMWARE = Path(__file__).parents[2] / "firmware_c"
PRESET, MODEL = load_pair("paper_calibrated", None)
LEAST_TIMES_REAL_TIME = 20.0
MOST_RAM_BYTES = 16 * 1024
MOST_INSTRUCTIONS = 210_000
"""Of 96 cells with all frames; the core alone is held to 200,000 by test_pack_cost.py."""
HAS_TOOLS = shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Folder and printed summary of a whole charge."""
    folder = tmp_path_factory.mktemp("pack")
    done = bms("sil", "--cells", 5, "--seed", 1, "--out", folder / "out", "--json")
    assert done.returncode == 0, done.stderr
    return folder / "out", json.loads(done.stdout)


def test_a_charge_leaves_summary_picture_page_and_log(out):
    folder, said = out
    assert {path.name for path in folder.iterdir()} == {
        "summary.json",
        "pack.png",
        "report.html",
        "can.log",
    }
    assert json.loads((folder / "summary.json").read_text()) == said
    png = (folder / "pack.png").read_bytes()
    assert png.startswith(b"\x89PNG") and len(png) > 20_000
    frames = round(said["frames_per_period"] * said["steps"], 6)
    assert len(list(read_log(folder / "can.log"))) == frames


def test_the_page_holds_its_picture_and_a_row_for_each_cell(out):
    folder, _ = out
    page = (folder / "report.html").read_text()
    assert "data:image/png;base64," in page
    rows = page.split("What was left of each limit")[1]
    assert sorted(map(int, re.findall(r"<tr><td>(\d+)</td>", rows))) == [1, 2, 3, 4, 5]


def test_the_summary_says_what_governed_and_what_every_cell_left(out):
    _, said = out
    margins = said["worst_margins"]
    assert [row["cell"] for row in margins] == [1, 2, 3, 4, 5]
    assert all(value >= 0.0 for row in margins for value in row.values())
    assert said["cells_over"] == 0
    limits = PRESET.limits
    least_K = min(row["core_temperature_K"] for row in margins)
    assert limits.max_core_temperature_K - least_K == pytest.approx(said["max_core_temperature_K"])
    assert str(said["weakest_cell"]) in said["governed_s"]
    assert sum(said["governed_s"].values()) <= said["charge_time_s"]
    assert sum(said["constraint_s"].values()) == pytest.approx(sum(said["governed_s"].values()))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--cells 193", "from 1 to 192"),
        ("--cells 4 --mode fastest", "--mode: is for one cell"),
        ("--cells 4 --realtime", "--realtime: is for one cell"),
        ("--cells 4 --baseline s-cbf", "--baseline: is for one cell"),
        ("--cells 4 --preset lin2014", "alpha2"),
        ("--spread none", "add --cells"),
        ("--per-thermistor 2", "add --cells"),
        ("--cells 4 --preset a123_26650 --per-thermistor 2", "thermistor"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(arguments, said):
    done = bms("sil", *arguments.split())
    assert done.returncode == 2 and done.stdout == ""
    (line,) = done.stderr.strip().splitlines()
    assert said in line


def test_192_cells_run_at_least_twenty_times_real_time():
    result = charge_pack(PackChargeSettings(PRESET, MODEL, 192, max_time_s=30.0))
    times = result.steps * PRESET.timing.sampling_period_s / result.wall_time_s
    assert times >= LEAST_TIMES_REAL_TIME


@pytest.mark.skipif(not shutil.which("arm-none-eabi-gcc"), reason="no arm-none-eabi-gcc")
def test_the_ecu_of_96_cells_fits_into_16_kib(tmp_path):
    source = tmp_path / "size.c"
    source.write_text('#include "pack_ecu.h"\nconst unsigned size = sizeof(pack_ecu_t);\n')
    includes = [f"-I{FIRMWARE / p}" for p in ("include", "pack", "pack/generated", "pack_ecu")]
    done = subprocess.run(
        [
            "arm-none-eabi-gcc", "-std=c99", "-mcpu=cortex-m4", "-mthumb", "-DBMS_MAX_CELLS=96",
            "-DBMS_MAX_FAMILY_CELLS=1", *includes, "-S", "-o", "-", source,
        ],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    match = re.search(r"^size:\n\s+\.word\s+(\d+)$", done.stdout, re.MULTILINE)
    assert match and 8 * 1024 < int(match[1]) <= MOST_RAM_BYTES


@pytest.mark.slow
@pytest.mark.skipif(not HAS_TOOLS, reason="needs gcc-arm-none-eabi and qemu-system-arm")
def test_instructions_of_the_ecu_with_all_frames_are_linear_in_the_cells(tmp_path):
    program = tmp_path / "pack_ecu_cost.elf"
    make = ["make", "-s", "-f", "firmware_c/pack_cost/pack_cost.mk", f"BUILD={tmp_path}"]
    subprocess.run(
        [*make, f"PYTHON={sys.executable}", str(program)], cwd=FIRMWARE.parent, check=True
    )
    counted = {one.cells: one for one in ecu_instructions(program)}
    assert {cells: one.frames for cells, one in counted.items()} == {1: 6, 16: 21, 96: 74, 192: 138}
    assert all(one.periods > 50 for one in counted.values())
    assert counted[96].most <= MOST_INSTRUCTIONS
    steps = ((1, 16), (16, 96), (96, 192))
    few, many, most = ((counted[b].most - counted[a].most) / (b - a) for a, b in steps)
    assert max(many, most) <= 1.05 * min(many, most)
    # From one cell to 16 each brings a frame of its own, after that three cells bring two.
    assert many < few <= 1.15 * many


def test_a_program_that_is_not_built_is_refused_with_the_command_that_builds_it(tmp_path):
    with pytest.raises(InputError, match=r"not built; run 'make -f firmware_c/pack_cost"):
        ecu_instructions(tmp_path / "none.elf")


def test_the_ecu_allocates_nothing_and_keeps_nothing_outside_of_its_state():
    text = "".join(path.read_text() for path in (FIRMWARE / "pack_ecu").glob("*.c"))
    assert not re.search(r"\b(malloc|calloc|realloc|free|printf)\b", text)
    assert not re.search(r"^static (?!const|inline|\w+ \*?\w+\(|const)\w+ \w+( =|;|\[)", text, re.M)


def test_frames_of_chance_bring_no_current_and_no_harm():
    """Any identifier, length and content, right checksums among them by chance."""
    ecu = PackEcu(PackChargeSettings(PRESET, MODEL, 4))
    rng = np.random.default_rng(0)
    ids = [0x080, 0x200, 0x201, 0x202, 0x210, 0x213, 0x220, 0x230, 0x7FF]
    for _ in range(300):
        frames = [
            Frame(int(rng.choice(ids)), rng.bytes(int(rng.integers(0, 9)))) for _ in range(40)
        ]
        ecu.exchange(frames)
        assert ecu.state.command_A == 0.0


def test_a_stream_without_sync_is_not_kept():
    ecu = PackEcu(PackChargeSettings(PRESET, MODEL, 4))
    for _ in range(2000):
        ecu.receive(0x7FF, b"")
    assert len(ecu._waiting) < 301 * 16


@pytest.mark.parametrize("request_code", [2, 7, 15])
def test_a_request_that_is_not_known_stops_the_charge_at_once(request_code):
    settings = PackChargeSettings(PRESET, MODEL, 4)
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire = PackWire(settings, plant)
    for period in range(80):
        plant.measure()
        frames = wire.publish(charge=period > 20, request=request_code if period >= 70 else None)
        heard = wire.hear(ecu.exchange(frames))
        plant.hold(obeyed_A(heard))
        if period == 69:
            assert heard.command_A < -10.0
        if period >= 70:
            assert heard.command_A == 0.0
            assert heard.active_faults >> lib.FAULT_REQUEST_INVALID & 1
