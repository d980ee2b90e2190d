"""`bms bench` compares before it times, times what it says, and names what it did not run."""

import json
import statistics
import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

from bms.cell import CellState, integrate_step
from bms.image import TARGETS
from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.faults import load_faults
from hil_sim.run.settings import Settings
from hil_sim.studies.bench import simulation
from hil_sim.studies.bench.aims import aims
from hil_sim.studies.bench.board import BoardCost, board_costs
from hil_sim.studies.bench.generated_solver import GENERATED
from hil_sim.studies.bench.layers import sampled
from hil_sim.studies.bench.machine import this_machine
from hil_sim.studies.bench.problem import charge_problem
from hil_sim.studies.bench.race import Absent, Clocks, Peer, Quartiles, WrongAnswerError, race
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.simulation import BusSpeed, bus_speed
from hil_sim.studies.bench.throughput import Throughput
from tests.firmware.constraints import interval, quadratics

RIGHT = np.array([1.0, 2.0, 3.0, 4.0])
PEERS = ("KAN in C", "KAN in SciPy, one at a time", "SciPy SLSQP", "OSQP, warm update and solve")


def ticks(*durations_ns):
    """A clock that is read twice a repetition, with these times in between."""
    now = 0
    for duration_ns in durations_ns:
        yield now
        now += duration_ns
        yield now


def peer(answers, rows=None, tolerance=0.5):
    return Peer("peer", "package 1", lambda: np.asarray(answers), tolerance, rows)


def test_time_is_the_median_of_the_repetitions_for_each_answer():
    durations_ns = (400, 800, 4000, 80, 1200)
    clock = ticks(*durations_ns)
    (row,) = race(RIGHT, [peer(RIGHT)], 5, lambda: next(clock))
    per_answer = [duration / 4 for duration in durations_ns]
    low, median, high = statistics.quantiles(per_answer, n=4, method="inclusive")
    assert row.time_ns == Quartiles(median, low, high, 5)
    assert row.answers == 4


def test_a_peer_may_answer_some_of_the_problems():
    clock = ticks(20)
    (row,) = race(RIGHT, [peer([2.1, 4.0], rows=np.array([1, 3]))], 1, lambda: next(clock))
    assert row.time_ns.median == 10
    assert row.largest_difference == pytest.approx(0.1)


@pytest.mark.parametrize("answers", [[1.0, 2.0, 3.0, 4.6], [1.0, float("nan"), 3.0, 4.0]])
def test_a_peer_that_answers_wrongly_is_refused_before_it_is_timed(answers):
    with pytest.raises(WrongAnswerError, match="peer"):
        race(RIGHT, [peer(RIGHT), peer(answers)], 1, iter([0, 1]).__next__)


def test_an_absent_peer_stays_in_the_table():
    absent = Absent("other", "not installed")
    assert race(RIGHT, [absent], 1, lambda: 0) == [absent]


@pytest.fixture(scope="module")
def problem():
    return charge_problem(DEFAULT_PRESET, 400.0)


def test_the_solvers_are_given_the_printed_constraints(problem):
    """Against the constraints as design page 1 prints them, in code of their own."""
    for row in problem.sample(40):
        state = {name: column[row] for name, column in problem.states._asdict().items()}
        state["cooling_power_W"] = problem.cooling_power_W[row]
        groups = quadratics(problem.firmware.parameters, state)
        for side in problem.quadratics[row]:
            assert any(side == pytest.approx(other, abs=1e-9) for g in groups for other in g)
        lower_A, upper_A = interval(groups, problem.reference_current_A)
        assert problem.lower_A[row] == pytest.approx(lower_A, abs=1e-6)
        assert problem.upper_A[row] == pytest.approx(upper_A, abs=1e-6)
    assert problem.lower_A.min() == problem.reference_current_A < problem.lower_A.max() - 1.0


def test_every_way_to_the_same_answer_is_compared_timed_and_named(bms):
    code, out, _ = bms(
        "bench", "--quick", "--json", "--section", "estimate", "--section", "decision",
        "--section", "period",
    )  # fmt: skip
    assert code == 0
    result = json.loads(out)
    assert result["pinned_to_core"] is not None
    assert set(result["machine"]) == {"cpu", "cores", "system", "python", "load_average"}
    rows = {row["name"]: row for key in ("estimate", "decision") for row in result[key]}
    assert set(PEERS) <= set(rows)
    assert any("pykan" in name for name in rows)
    assert any("CVXPYgen" in name for name in rows)
    for row in rows.values():
        if "not_run" in row:
            assert "pip install" in row["not_run"]
            continue
        quartiles = row["lower_quartile_time_ns"], row["upper_quartile_time_ns"]
        assert 0.0 < quartiles[0] <= row["median_time_ns"] <= quartiles[1]
        assert row["package"].split()[1]
        assert row["answers_a_repetition"] >= 100
    assert rows["KAN in C"]["largest_difference_K"] < 1e-3
    assert rows["SciPy SLSQP"]["largest_difference_A"] < 1e-2
    (period,) = result["period"]
    assert period["answers_a_repetition"] >= result["states"] > 5000
    both_ns = rows["KAN in C"]["median_time_ns"] + rows["closed form in C"]["median_time_ns"]
    in_time = {aim["name"]: aim for aim in result["aims"] if aim["unit"] == "ns"}
    aim = in_time["estimate plus decision in C"]
    assert aim["measured"] == both_ns
    assert aim["is_reached"] == (both_ns <= 100.0)
    assert in_time["control period with frames in C"]["measured"] == period["median_time_ns"]
    assert result["simulation"] == result["campaign"] == []


@pytest.mark.parametrize(
    ("modules", "section", "key", "name"),
    [
        (("osqp",), "decision", "decision", "OSQP, warm update and solve"),
        (("cvxpy", "cvxpygen"), "decision", "decision", GENERATED),
        (("torch", "kan"), "estimate", "estimate", "KAN in pykan"),
        (("torch", "kan"), "estimate", "perceptron", "PyTorch"),
    ],
)
def test_exactly_what_is_installed_is_timed(bms, modules, section, key, name):
    is_installed = all(find_spec(module) for module in modules)
    _, out, _ = bms("bench", "--quick", "--json", "--section", section)
    rows = [row for row in json.loads(out)[key] if name in row["name"]]
    assert rows or not is_installed
    assert all(("median_time_ns" in row) == is_installed for row in rows)


@pytest.mark.parametrize(
    "module", ["hil_sim.studies.bench.torch_estimate", "bms.studies.rivals.perceptron"]
)
def test_a_module_of_our_own_that_does_not_import_is_no_missing_package(bms, monkeypatch, module):
    monkeypatch.delitem(sys.modules, "hil_sim.studies.bench.torch_estimate", raising=False)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=module):
        bms("bench", "--quick", "--section", "estimate")


def test_answers_that_differ_end_in_exit_code_1_with_the_names(bms, monkeypatch):
    monkeypatch.setattr("hil_sim.studies.bench.decision.SOLVER_TOLERANCE_A", 0.0)
    code, out, err = bms("bench", "--quick", "--section", "decision")
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith("bms: OSQP, set-up and solve: answers ")


def test_what_is_not_installed_is_named_with_the_remedy(bms, monkeypatch):
    monkeypatch.delitem(sys.modules, "hil_sim.studies.bench.torch_estimate", raising=False)
    for module in ("osqp", "torch"):
        monkeypatch.setitem(sys.modules, module, None)
    code, out, _ = bms("bench", "--quick", "--section", "decision", "--section", "estimate")
    assert code == 0
    assert "not run: OSQP: not installed; pip install osqp" in out
    assert "pip install pykan" in out
    assert "SciPy SLSQP" in out


def test_simulation_tells_its_speed_and_what_it_spends_time_on(bms):
    code, out, _ = bms(
        "bench", "--quick", "--json", "--section", "simulation",
        "--bus", "virtual:bench-test", "--bus", "nonsense:1",
    )  # fmt: skip
    assert code == 0
    virtual, nonsense = json.loads(out)["simulation"]
    assert virtual["periods"] == 204
    assert virtual["median_speed_times_real_time"] > 1.0
    assert sum(virtual["layer_shares_percent"].values()) == pytest.approx(100.0)
    assert "choose an interface that python-can knows" in nonsense["not_run"]


def test_a_bus_that_was_not_run_is_named_without_an_empty_table(bms):
    code, out, _ = bms("bench", "--quick", "--section", "simulation", "--bus", "nonsense:1")
    assert code == 0
    assert "not run: nonsense:1: " in out
    assert "x real time" not in out
    assert "spends that time on" not in out


@pytest.mark.parametrize("name", ["vcan0", ":vcan0", "socketcan:"])
def test_a_malformed_bus_is_refused_before_anything_is_timed(bms, name):
    code, out, err = bms("bench", "--quick", "--bus", "virtual:bench-test", "--bus", name)
    assert (code, out) == (2, "")
    assert err == f"bms: --bus '{name}': not interface:channel; write for example virtual:bench\n"


def test_speed_leaves_out_the_time_before_the_first_answer():
    wall = iter([10_000_000_000, *range(11_000_000_000, 99_000_000_000, 10_000_000)])
    cpu = iter([3_000_000_000, 3_000_000_000 + 285_000_000, 0, 0])
    clocks = Clocks(wall.__next__, cpu.__next__)
    speed = bus_speed("virtual:bench-clock", DEFAULT_PRESET, 1.0, 1, clocks, 1)
    periods = speed.periods
    measured_s = 1.0 + (periods - 2) * 0.01
    assert speed.times_real_time.median == pytest.approx((periods - 1) * 0.1 / measured_s)
    assert speed.processor_share_percent == pytest.approx(28.5 / measured_s)


def test_a_charge_that_fails_has_no_speed(monkeypatch, tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text('[[fault]]\nkind = "message-lost"\nmessage = "CellThermal"\nfrom_s = 1\n')
    faulty = partial(Settings, faults=load_faults(path))
    monkeypatch.setattr(simulation, "Settings", faulty)
    clocks = Clocks(time.perf_counter_ns, time.process_time_ns)
    speed = bus_speed("virtual:bench-failure", DEFAULT_PRESET, 100.0, 1, clocks, 1)
    assert speed.times_real_time is None
    assert speed.not_run.startswith("charge failed: ")


def test_a_layer_is_charged_with_what_happens_below_it():
    cell = load_preset(DEFAULT_PRESET).cell
    with sampled() as layers:
        state = CellState(0.5, 300.0, 300.0, 300.0)
        for _ in range(20_000):
            state = integrate_step(cell, state, -1.0, 1.0, 0.01)
        layers.settle()
    assert layers.shares_percent["cell model"] > 80.0


def test_without_the_guest_a_socketcan_bus_is_not_run(monkeypatch, tmp_path):
    monkeypatch.setattr(simulation, "GUEST", tmp_path / "vcan_guest.sh")
    speed = bus_speed("socketcan:nothere0", DEFAULT_PRESET, 1.0, 1, Clocks(int, int), 2)
    assert speed.times_real_time is None
    assert "no vcan_guest.sh" in speed.not_run


def test_a_campaign_tells_its_throughput(bms):
    code, out, _ = bms(
        "bench", "--json", "--section", "campaign", "--campaign-runs", 2, "--campaign-runs", 4,
        "--jobs", 1,
    )  # fmt: skip
    assert code == 0
    rows = json.loads(out)["campaign"]
    assert [row["runs"] for row in rows] == [2, 4]
    for row in rows:
        assert row["runs_per_s"] == pytest.approx(row["runs"] / row["wall_time_s"])
    first, second = (row["wall_time_s"] / row["runs"] for row in rows)
    assert rows[0]["time_a_run_relative_to_first"] == 1.0
    assert rows[1]["time_a_run_relative_to_first"] == pytest.approx(second / first)


def test_the_guest_runs_the_same_and_answers_in_json():
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "hil_sim.studies.bench",
            "virtual:guest",
            DEFAULT_PRESET,
            "1.0",
            "2",
            "1",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    speed = json.loads(done.stdout)
    assert speed["bus"] == "virtual:guest"
    assert speed["parties"] == "one process"
    assert speed["times_real_time"]["repetitions"] == 2


MEASURED = BoardCost("mps2-an386", 1000, 4001, 16 * 1024, 32 * 1024 + 1)


def speed_of(bus, processes, times):
    return BusSpeed(bus, processes, "parties", 10, Quartiles(times, times, times, 3), 100.0, {})


def test_an_aim_is_reached_on_its_bound_and_missed_beyond_it():
    """Instructions, bytes and ns are to be small, multiples and runs large."""
    result = Result(
        this_machine(),
        simulation=[
            speed_of("virtual:x", 1, 1000.0),
            speed_of("socketcan:vcan0", 1, 24.9),
            speed_of("socketcan:vcan0", 2, 15.0),
            speed_of("udp_multicast:1", 2, 1.0),
        ],
        campaign=[Throughput(100, 2, 1.0, 100.0), Throughput(1000, 2, 4.0, 260.0)],
        board=[MEASURED, BoardCost("mps2-an385", None, None, None, None, "not built")],
    )
    found = {aim.name: (aim.measured, aim.is_reached) for aim in aims(result)}
    assert found == {
        "simulation on virtual:x, parties": (1000.0, True),
        "simulation on socketcan:vcan0, parties": (15.0, True),
        "campaign, runs a second and core": (130.0, True),
        "estimate and decision, worst of a charge on mps2-an386": (1000, True),
        "control period with frames, median on mps2-an386": (4001, False),
        "flash of the application on mps2-an386": (16 * 1024, True),
        "flash of the image on mps2-an386": (32 * 1024 + 1, False),
    }
    assert [aim.is_reached for aim in aims(result)][1] is False


def test_a_board_whose_program_is_not_built_is_named_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr("hil_sim.studies.bench.board.built_folder", lambda board: tmp_path)
    costs = board_costs(DEFAULT_PRESET)
    assert [cost.board for cost in costs] == list(TARGETS)
    for cost in costs:
        assert cost.period_median is None
        assert "make" in cost.not_run
        assert cost.image_flash_B > cost.application_flash_B > 0
