"""All sections of the benchmark in one run on one machine."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from enum import Enum
from importlib import import_module

from bms.errors import InputError
from hil_sim.studies.bench.board import BoardCost, board_costs
from hil_sim.studies.bench.campaign_parts import CampaignParts, campaign_parts
from hil_sim.studies.bench.counted import instructions_of_period
from hil_sim.studies.bench.decision import (
    decision_from_python,
    decision_in_c,
    osqp_decisions,
    slsqp_decision,
)
from hil_sim.studies.bench.estimate import estimate_from_python, estimate_in_c, scipy_estimates
from hil_sim.studies.bench.generated_solver import GENERATED, generated_solver
from hil_sim.studies.bench.machine import Machine, one_core, this_machine
from hil_sim.studies.bench.period import control_periods, recorded_commands_A
from hil_sim.studies.bench.problem import Problem, charge_problem
from hil_sim.studies.bench.race import Absent, ClockNs, Clocks, Peer, Timed, race
from hil_sim.studies.bench.simulation import BusSpeed, bus_speed, processes_on
from hil_sim.studies.bench.throughput import Throughput, campaign_throughput

Note = Callable[[str], None]


class Section(str, Enum):
    """The sections of the benchmark, by their names on the command line."""

    ESTIMATE = "estimate"
    DECISION = "decision"
    PERIOD = "period"
    SIMULATION = "simulation"
    CAMPAIGN = "campaign"
    BOARD = "board"


_TIMED = {Section.ESTIMATE, Section.DECISION, Section.PERIOD}
"""All of them on the states of one charge."""


@dataclass(frozen=True)
class Effort:
    """How often everything is repeated, and the simulated time of a charge on a bus at most."""

    repetitions: int
    simulation_repetitions: int
    simulation_time_s: float
    campaign_runs: int
    """Of which the parts are timed."""


FULL = Effort(11, 3, 3600.0, 100)
QUICK = Effort(3, 1, 20.0, 3)


@dataclass
class Result:
    """What was measured; a section that was not asked for is empty."""

    machine: Machine
    states: int = 0
    core: int | None = None
    """Number of the core that everything up to the simulation was kept on."""
    estimate: list[Timed | Absent] = field(default_factory=list)
    perceptron: list[Timed | Absent] = field(default_factory=list)
    decision: list[Timed | Absent] = field(default_factory=list)
    period: list[Timed | Absent] = field(default_factory=list)
    period_instructions: dict[str, float] = field(default_factory=dict)
    """By function of the firmware; empty where they cannot be counted."""
    period_not_counted: str = ""
    simulation: list[BusSpeed] = field(default_factory=list)
    campaign: list[Throughput] = field(default_factory=list)
    campaign_parts: CampaignParts | None = None
    board: list[BoardCost] = field(default_factory=list)


def step_count(sections: set[Section], buses: list[str], campaign_runs: list[int]) -> int:
    """How often run_benchmark tells what comes next."""
    timed = sections & _TIMED
    steps = len(timed) + 1 if timed else 0
    if Section.SIMULATION in sections:
        steps += sum(len(processes_on(bus)) for bus in buses)
    steps += Section.BOARD in sections
    return steps + (len(campaign_runs) + 1 if Section.CAMPAIGN in sections else 0)


def run_benchmark(
    sections: set[Section],
    preset: str,
    effort: Effort,
    buses: list[str],
    campaign_runs: list[int],
    jobs: int,
    clocks: Clocks,
    note: Note = lambda text: None,
) -> Result:
    """Run what is asked for; `note` is told what comes next.

    Raises WrongAnswerError when two ways to the same answers differ.
    """
    result = Result(this_machine())
    if sections & _TIMED:
        note("the charge that everything is timed on")
        problem = charge_problem(preset)
        result.states = len(problem.lower_A)
        with one_core() as result.core:
            if Section.ESTIMATE in sections:
                note("estimate of the core temperature")
                _estimate(result, problem, effort.repetitions, clocks.cpu_ns)
            if Section.DECISION in sections:
                note("decision on the current")
                _decision(result, problem, effort.repetitions, clocks.cpu_ns)
            if Section.PERIOD in sections:
                note("whole control period")
                commands_A, peers = recorded_commands_A(problem), [control_periods(problem)]
                result.period = race(commands_A, peers, effort.repetitions, clocks.cpu_ns)
                _count_period(result, problem)
    repetitions, time_s = effort.simulation_repetitions, effort.simulation_time_s
    for bus in buses if Section.SIMULATION in sections else ():
        for processes in processes_on(bus):
            note(f"simulation on {bus}")
            speed = bus_speed(bus, preset, time_s, repetitions, clocks, processes)
            result.simulation.append(speed)
    for runs in campaign_runs if Section.CAMPAIGN in sections else ():
        note(f"campaign of {runs} runs")
        result.campaign.append(campaign_throughput(preset, runs, jobs, clocks.wall_ns))
    if result.campaign:
        note("parts of a campaign")
        result.campaign_parts = campaign_parts(preset, effort.campaign_runs, clocks.cpu_ns)
    if Section.BOARD in sections:
        note("instructions on the boards")
        result.board = board_costs(preset)
    return result


def _estimate(result: Result, problem: Problem, repetitions: int, clock_ns: ClockNs) -> None:
    peers: list[Peer | Absent] = [estimate_in_c(problem), estimate_from_python(problem)]
    peers += scipy_estimates(problem)
    if _is_installed("torch", "kan"):
        # PyTorch is an optional extra.
        from hil_sim.studies.bench.torch_estimate import pykan_estimates, torch_perceptron  # noqa: PLC0415

        perceptron = torch_perceptron(problem)
        result.perceptron = race(perceptron.reference, perceptron.peers, repetitions, clock_ns)
        peers += pykan_estimates(problem)
    else:
        peers.append(
            Absent(
                "KAN in pykan, and MLP in PyTorch", "not installed; pip install pykan==0.2.8 torch"
            )
        )
    result.estimate = race(problem.core_temperature_K, peers, repetitions, clock_ns)


def _count_period(result: Result, problem: Problem) -> None:
    try:
        result.period_instructions = instructions_of_period(problem)
    except InputError as error:
        result.period_not_counted = str(error)


def _decision(result: Result, problem: Problem, repetitions: int, clock_ns: ClockNs) -> None:
    peers: list[Peer | Absent] = [decision_in_c(problem), decision_from_python(problem)]
    if _is_installed("osqp"):
        peers += osqp_decisions(problem)
    else:
        peers.append(Absent("OSQP", "not installed; pip install osqp"))
    peers.append(slsqp_decision(problem))
    with _generated(problem) as peer:
        result.decision = race(problem.lower_A, [*peers, peer], repetitions, clock_ns)


def _is_installed(*modules: str) -> bool:
    """Whether optional packages import; some take seconds."""
    try:
        for module in modules:
            import_module(module)
    except ImportError:
        return False
    return True


@contextmanager
def _generated(problem: Problem) -> Iterator[Peer | Absent]:
    with ExitStack() as stack:
        peer: Peer | Absent = Absent(GENERATED, "not installed; pip install cvxpygen")
        try:
            if _is_installed("cvxpy", "cvxpygen"):
                peer = stack.enter_context(generated_solver(problem))
        except (OSError, subprocess.CalledProcessError) as error:
            peer = Absent(GENERATED, f"its code does not compile here ({error})")
        yield peer
