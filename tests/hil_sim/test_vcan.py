"""ECU and plant as two processes on a real SocketCAN bus, in the guest where the host has none."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.bus import buses
from hil_sim.bus.catalog import Mode
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

GUEST = Path(__file__).parents[2] / "tools" / "vcan_guest.sh"
PACKAGED = buses.GUEST
"""What it calls, of the package."""
HAS_VCAN = Path("/sys/class/net/vcan0").exists()
HAS_GUEST = Path("/usr/bin/linux.uml").exists()
MISSING = "no vcan0 and no user-mode-linux: apt-get install -y user-mode-linux"

pytestmark = pytest.mark.skipif(not (HAS_VCAN or HAS_GUEST or "CI" in os.environ), reason=MISSING)

SEED = 5
TIMEOUT_S = 240
SCRIPT = """
# python-can imports asammdf where it is, which takes seconds here and is not needed.
bms=("$PYTHON" -c 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()')
bus=(--bus socketcan:vcan0)

"${bms[@]}" plant "${bus[@]}" --answer-timeout-s 0.1 2> alone.err; echo $? > alone.status

( "${bms[@]}" ecu "${bus[@]}" --silence-s 2 > ecu.out; echo $? > ecu.status ) &
"${bms[@]}" plant "${bus[@]}" --seed SEED --max-time-s MAX_TIME MODE --out run --json > plant.json
echo $? > plant.status
wait

"${bms[@]}" ecu "${bus[@]}" --realtime > realtime.out &
ecu=$!
"${bms[@]}" plant "${bus[@]}" --realtime --max-time-s 3 --json > realtime.json
kill -TERM $ecu
wait $ecu; echo $? > realtime.status
"""


def run_in_guest(*command, folder):
    environment = {**os.environ, "PYTHON": sys.executable, "VCAN_TIMEOUT_S": str(TIMEOUT_S)}
    return subprocess.run(
        [GUEST, *command], cwd=folder, env=environment, capture_output=True, text=True, check=False,
        timeout=TIMEOUT_S + 60,  # the guest ends by itself, a real vcan0 has none
    )  # fmt: skip


# A whole charge takes minutes in the guest. Of the shorter one the charger asks for a current of
# its own, so that derating has begun by the end; a planned one derates after 400 s.
WHOLE_S, SHORT_S = 3600.0, 200.0
MODES = {WHOLE_S: None, SHORT_S: Mode.FIXED}


@pytest.fixture(
    scope="module", params=[SHORT_S, pytest.param(WHOLE_S, marks=pytest.mark.long("vcan"))]
)
def max_time_s(request):
    return request.param


@pytest.fixture(scope="module")
def guest(tmp_path_factory, max_time_s):
    folder = tmp_path_factory.mktemp("vcan")
    mode = "" if MODES[max_time_s] is None else f"--mode {MODES[max_time_s].label}"
    script = SCRIPT.replace("SEED", str(SEED)).replace("MAX_TIME", str(max_time_s))
    script = script.replace("MODE", mode)
    done = run_in_guest("bash", "-c", script, folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


def status(path):
    return int(path.read_text())


def test_two_processes_give_the_frames_of_the_virtual_bus(guest, max_time_s, preset, tmp_path):
    with Recorder(tmp_path / "can.log") as recorder:
        settings = Settings(preset, seed=SEED, max_time_s=max_time_s, mode=MODES[max_time_s])
        expected = run_both(settings, recorder).summary
    assert (guest / "run" / "can.log").read_bytes() == (tmp_path / "can.log").read_bytes()
    summary = json.loads((guest / "plant.json").read_text())
    for key, value in expected.to_json().items():
        if key not in ("bus", "wall_time_s"):
            assert summary[key] == value
    assert summary["bus"] == "socketcan:vcan0"
    assert summary["limits_kept"] is True
    assert summary["stop_reason"] == ("complete" if max_time_s == WHOLE_S else "time-limit")
    assert summary["first_derate_s"] is not None


def test_both_processes_end_well_and_the_ecu_saw_every_frame(guest, max_time_s):
    steps = json.loads((guest / "plant.json").read_text())["steps"]
    assert status(guest / "plant.status") == (0 if max_time_s == WHOLE_S else 1)
    assert status(guest / "ecu.status") == 0
    # SYNC, four messages of every charge, and the mode where one is asked for.
    frames = (5 if MODES[max_time_s] is None else 6) * steps
    assert f"{frames} frames received, {steps} steps" in (guest / "ecu.out").read_text()


def test_a_plant_without_an_ecu_says_how_to_start_one(guest):
    assert status(guest / "alone.status") == 2
    (line,) = (guest / "alone.err").read_text().splitlines()
    assert "bms ecu --bus socketcan:vcan0" in line


def test_in_real_time_both_run_on_clocks_of_their_own_and_the_ecu_obeys_sigterm(guest):
    summary = json.loads((guest / "realtime.json").read_text())
    assert summary["realtime"] is True
    assert summary["wall_time_s"] >= 2.9
    preset = load_preset(DEFAULT_PRESET)
    growth_A_per_s = preset.limits.current_growth_A_per_s
    charged_As = (summary["final_soc"] - preset.initial.soc) * preset.cell.capacity_As
    ideal_As = 0.5 * growth_A_per_s * 3.0**2
    # How much of the ideal is reached depends on how late the machine is with the answers.
    assert 0.0 < charged_As < 1.1 * ideal_As
    assert summary["limits_kept"] is True
    assert status(guest / "realtime.status") == 0
    assert "steps" in (guest / "realtime.out").read_text()


def test_in_real_time_both_sides_tell_how_punctual_they_were(guest):
    summary = json.loads((guest / "realtime.json").read_text())
    timing = summary["timing"]
    assert timing["periods"] == summary["steps"] > 30
    assert 0 <= timing["missed_deadlines"] < timing["periods"]
    assert timing["lateness"]["max_ms"] >= timing["lateness"]["median_ms"] > 0.0
    assert 0.0 < timing["answer_latency"]["median_ms"] < timing["period_ms"]
    assert timing["longest_without_command_periods"] <= timing["periods_without_command"]
    late, missed = (guest / "realtime.out").read_text().splitlines()[1:]
    assert re.fullmatch(r"steps began late by: (\w+ [\d.]+ ms(, )?){4}", late)
    assert re.fullmatch(
        r"deadlines missed: \d+ \(allowed: 50 ms\), steps left out: \d+, "
        r"longest stall: [\d.]+ ms",
        missed,
    )


def test_the_benchmark_finds_the_bus_in_the_guest(bms):
    code, out, _ = bms(
        "bench", "--quick", "--json", "--section", "simulation", "--bus", "socketcan:vcan0"
    )
    assert code == 0
    one, two = json.loads(out)["simulation"]
    assert one["parties"].startswith("one process")
    assert two["parties"].startswith("two processes")
    for speed in (one, two):
        assert speed["periods"] == 204
        assert speed["median_speed_times_real_time"] > 1.0


@pytest.mark.parametrize("code", [0, 7])
def test_the_guest_passes_on_output_and_exit_status(tmp_path, code):
    script = f"echo out; echo 'two  words' >&2; pwd; cat /sys/class/net/vcan0/mtu; exit {code}"
    done = run_in_guest("bash", "-c", script, folder=tmp_path)
    assert done.returncode == code
    assert done.stdout.splitlines() == ["out", str(tmp_path), "72"]
    assert done.stderr == "two  words\n"


def test_without_the_package_the_guest_names_it(tmp_path):
    script = tmp_path / "guest.sh"
    script.write_text(PACKAGED.read_text().replace("/usr/bin/linux.uml", "/not/there"))
    done = subprocess.run(
        ["bash", script, "true"],
        env={**os.environ, "VCAN_FORCE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 69
    assert "apt-get install -y --no-install-recommends user-mode-linux" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_guest_without_a_command_says_how_to_use_it(tmp_path):
    done = run_in_guest(folder=tmp_path)
    assert done.returncode == 64
    assert done.stderr.startswith("vcan_guest: usage:")
