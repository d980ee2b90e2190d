"""Ways to the charging current: the firmware's closed form, and iterative solvers.

The program of one state is to find the current nearest to the reference within the constraints,
which are quadratic. The solver of the paper, SLSQP, is given the quadratics. A solver of
quadratic programs cannot be; it is given the interval that they leave, and the time to find that is
not counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csc_matrix

from bms.arrays import Array
from bms.firmware.batches import DecisionBatch
from hil_sim.studies.bench.estimate import FEW, SOME
from hil_sim.studies.bench.machine import THIS_PROJECT, package
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer, Rows

C_TOLERANCE_A = 1e-3
SOLVER_TOLERANCE_A = 1e-2
"""A two-thousandth of the current; solvers are told to stop at a tenth of that."""
SOLVER_PRECISION = 1e-5


def decision_in_c(problem: Problem) -> Peer:
    """The firmware's decision in a loop in C."""
    firmware = problem.firmware
    calls = _calls(problem, np.arange(len(problem.lower_A)))
    batch = DecisionBatch(firmware.preset, firmware.model, calls)

    def solve() -> Array:
        return batch.run().astype(np.float64)

    return Peer("closed form in C", THIS_PROJECT, solve, C_TOLERANCE_A)


def decision_from_python(problem: Problem) -> Peer:
    """The firmware's decision, each a call of bms.firmware.Firmware."""
    rows = problem.sample(SOME)
    calls = _calls(problem, rows)
    decide: Any = problem.firmware.solve

    def solve() -> Array:
        return np.array([decide(**call).current_A for call in calls])

    return Peer("closed form in C, called from Python", THIS_PROJECT, solve, C_TOLERANCE_A, rows)


def _calls(problem: Problem, rows: Rows) -> list[dict[str, float]]:
    """Keyword arguments of decisions."""
    names = (*problem.states._fields, "cooling_power_W")
    values = np.column_stack([*problem.states, problem.cooling_power_W])[rows].tolist()
    reference = {"reference_current_A": problem.reference_current_A}
    return [{**dict(zip(names, row)), **reference} for row in values]


def slsqp_decision(problem: Problem) -> Peer:
    """SciPy's SLSQP on the quadratics, with derivatives, from half the reference."""
    reference_A = problem.reference_current_A
    few = problem.sample(FEW)
    quadratics = problem.quadratics[few]
    programs = list(quadratics / np.abs(quadratics[:, :, 1:]).sum(axis=2, keepdims=True))

    def one(rows: Array) -> float:
        answer = minimize(
            lambda u: (u[0] - reference_A) ** 2,
            [0.5 * reference_A],
            jac=lambda u: [2.0 * (u[0] - reference_A)],
            method="SLSQP",
            bounds=[(reference_A, 0.0)],
            constraints={
                "type": "ineq",
                "fun": lambda u: rows @ (1.0, u[0], u[0] * u[0]),
                "jac": lambda u: (rows @ (0.0, 1.0, 2.0 * u[0]))[:, None],
            },
            options={"ftol": SOLVER_PRECISION**2, "maxiter": 200},
        )
        return float(answer.x[0])

    def solve() -> Array:
        return np.array([one(rows) for rows in programs])

    return Peer("SciPy SLSQP", package("scipy"), solve, SOLVER_TOLERANCE_A, few)


def osqp_decisions(problem: Problem) -> list[Peer]:
    """OSQP set up anew for every state, and updated from state to state; ImportError without it."""
    from osqp import OSQP  # noqa: PLC0415 (an optional extra)

    few, one = problem.sample(FEW), csc_matrix([[1.0]])
    linear = np.array([-problem.reference_current_A])
    bounds = [
        (np.array([low]), np.array([high]))
        for low, high in zip(problem.lower_A[few], problem.upper_A[few])
    ]
    options = {"verbose": False, "eps_abs": SOLVER_PRECISION, "eps_rel": SOLVER_PRECISION}

    def cold() -> Array:
        answers = []
        for low, high in bounds:
            solver = OSQP()
            solver.setup(one, linear, one, low, high, **options)
            answers.append(solver.solve(raise_error=True).x[0])
        return np.array(answers)

    kept = OSQP()
    kept.setup(one, linear, one, *bounds[0], **options)

    def warm() -> Array:
        answers = []
        for low, high in bounds:
            kept.update(l=low, u=high)
            answers.append(kept.solve(raise_error=True).x[0])
        return np.array(answers)

    library = package("osqp")
    return [
        Peer("OSQP, set-up and solve", library, cold, SOLVER_TOLERANCE_A, few),
        Peer("OSQP, warm update and solve", library, warm, SOLVER_TOLERANCE_A, few),
    ]
