"""What a pack takes of its bus: computed from the database, and counted on the wire."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from pathlib import Path

import pytest

from bms.errors import InputError
from bms.model.pair import load_pair
from codegen.can_database import PACK, load_database
from hil_sim.logs import read_log
from hil_sim.logs.recorder import Recorder
from hil_sim.pack.budget import BIT_RATES, budget, most_bits, most_cells, require_fit
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import lib

BMS = Path(sys.executable).with_name("bms")


def bits_of(frame_id, data):
    """A frame bit by bit, with its stuff bits, as ISO 11898-1 has it: CRC-15, then stuffing."""
    bits = [0, *(frame_id >> i & 1 for i in reversed(range(11))), 0, 0, 0]
    bits += [len(data) >> i & 1 for i in reversed(range(4))]
    bits += [byte >> i & 1 for byte in data for i in reversed(range(8))]
    crc = 0
    for bit in bits:
        crc = (crc << 1 ^ (0x4599 if bit ^ (crc >> 14) else 0)) & 0x7FFF
    bits += [crc >> i & 1 for i in reversed(range(15))]
    stuffed, run, last = 0, 0, None
    for bit in bits:
        run, last = (run + 1, last) if bit == last else (1, bit)
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, 1 - bit
    return len(bits) + stuffed + 13


@pytest.fixture(scope="module", params=[1, 16, 192])
def wire(request, tmp_path_factory):
    """Frames of each period of a short run, between two SYNCs."""
    path = tmp_path_factory.mktemp("budget") / "can.log"
    preset, model = load_pair("paper_calibrated", None)
    with Recorder(path) as recorder:
        charge_pack(PackChargeSettings(preset, model, request.param, max_time_s=5.0), recorder)
    periods = [list(group) for _, group in itertools.groupby(read_log(path), lambda f: f.time_s)]
    return request.param, periods


def test_the_fullest_period_on_the_wire_has_the_frames_of_the_budget(wire):
    cells, periods = wire
    assert max(map(len, periods)) == budget(cells).frames


def test_no_period_on_the_wire_is_longer_than_its_budget(wire):
    cells, periods = wire
    longest = max(sum(bits_of(f.frame_id, f.data) for f in period) for period in periods)
    assert 0.8 * budget(cells).bits < longest <= budget(cells).bits


@pytest.mark.parametrize(("data_bytes", "most"), [(0, 55), (8, 135)])
def test_the_longest_frame_is_that_of_the_standard(data_bytes, most):
    """47 bits and 8 a byte, and a stuff bit for each four of 34 and 8 a byte after the first."""
    assert most_bits(data_bytes) == most


def test_no_frame_of_any_content_is_longer():
    for content in (bytes(8), b"\xff" * 8, b"\x0f\x83\xe0\xf8\x3e\x0f\x83\xe0", bytes([0x55] * 8)):
        assert bits_of(0x210, content) <= most_bits(8)


def test_192_cells_fit_into_500_kbit_and_1_mbit_but_not_into_125():
    need = budget(192)
    for rate in (500_000, 1_000_000):
        require_fit(need, rate)
    with pytest.raises(InputError) as refused:
        require_fit(need, 125_000)
    assert "take 105 cells at most, or a bus of 250 kbit/s" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("rate", BIT_RATES)
def test_what_is_said_to_fit_does_and_one_cell_more_does_not(rate):
    most = most_cells(rate, share=0.3)
    if most:
        require_fit(budget(most), rate, share=0.3)
    if most < 192:
        with pytest.raises(InputError):
            require_fit(budget(most + 1), rate, share=0.3)


def test_fewer_thermistors_take_fewer_frames():
    assert budget(96, 12).frames == budget(96).frames - 28


def test_the_command_says_how_many_cells_fit_with_as_few_thermistors():
    asked = [BMS, "pack-budget", "--per-thermistor", "2", "--bit-rate", "125000", "--json"]
    done = subprocess.run([*asked, "--cells", "120"], capture_output=True, text=True, check=True)
    most = json.loads(done.stdout)["most_cells"]["125000"]
    assert budget(most, -(-most // 2)).load(125_000) <= 1.0
    assert budget(most + 1, -(-(most + 1) // 2)).load(125_000) > 1.0
    refused = subprocess.run(
        [*asked, "--cells", str(most + 1)], capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2
    assert f"take {most} cells at most" in refused.stderr


def test_there_is_no_budget_for_more_cells_than_the_database_has():
    assert lib.BMS_MAX_CELLS == 192
    with pytest.raises(InputError, match="1 to 192"):
        budget(193)


def test_the_command_prints_the_budget_and_refuses_in_one_line():
    done = subprocess.run(
        [BMS, "pack-budget", "--cells", "96", "--json"], capture_output=True, text=True, check=True
    )
    said = json.loads(done.stdout)
    assert (said["frames"], said["bits"]) == (budget(96).frames, budget(96).bits)
    assert said["load"]["500000"] == pytest.approx(said["bits"] / 50_000)
    refused = subprocess.run(
        [BMS, "pack-budget", "--cells", "192", "--bit-rate", "125000"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert refused.returncode == 2 and refused.stdout == ""
    (line,) = refused.stderr.strip().splitlines()
    assert "105 cells" in line


def test_every_message_of_the_database_is_counted():
    """Fourteen messages without pages, SYNC among them, and six groups."""
    messages = load_database(PACK).messages
    singles = [m for m in messages if not m.is_multiplexed()]
    one = budget(1)
    assert one.frames == len(singles) + 6
    assert one.bits == sum(most_bits(m.length) for m in singles) + 6 * most_bits(8)
