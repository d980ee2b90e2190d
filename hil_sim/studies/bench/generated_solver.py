"""A solver for the decision's quadratic program that CVXPYgen writes in C, run in a loop in C."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from cffi import FFI

from bms.arrays import Array
from bms.native_build import FLAGS
from hil_sim.studies.bench.decision import SOLVER_PRECISION, SOLVER_TOLERANCE_A
from hil_sim.studies.bench.machine import package
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer

GENERATED = "CVXPYgen with OSQP, in C"
_FOLDER = "generated"
_DECLARATIONS = """
void set_up(double precision);
void solve_rows(double reference, const double *lower, const double *upper, unsigned rows,
                double *current);
"""
_LOOP = """
#include "cpg_solve.h"
#include "cpg_workspace.h"

void set_up(double precision)
{
    cpg_set_solver_eps_abs(precision);
    cpg_set_solver_eps_rel(precision);
}

void solve_rows(double reference, const double *lower, const double *upper, unsigned rows,
                double *current)
{
    for (unsigned i = 0u; i < rows; i++) {
        cpg_update_reference(reference);
        cpg_update_lower(lower[i]);
        cpg_update_upper(upper[i]);
        cpg_solve();
        current[i] = CPG_Result.prim->current;
    }
}
"""


@contextmanager
def generated_solver(problem: Problem) -> Iterator[Peer]:
    """The peer, as long as its code is there; ImportError when CVXPYgen is not installed."""
    library = package("cvxpygen")
    with TemporaryDirectory() as folder:
        ffi: Any = FFI()
        ffi.cdef(_DECLARATIONS)
        solver = ffi.dlopen(str(_compiled(Path(folder))))
        solver.set_up(SOLVER_PRECISION)
        lower_A, upper_A = problem.lower_A.copy(), problem.upper_A.copy()
        current_A = np.empty(len(lower_A))
        arguments = (
            problem.reference_current_A,
            ffi.from_buffer("double[]", lower_A),
            ffi.from_buffer("double[]", upper_A),
            len(lower_A),
            ffi.from_buffer("double[]", current_A, require_writable=True),
        )

        def solve() -> Array:
            solver.solve_rows(*arguments)
            return current_A.copy()

        yield Peer(GENERATED, library, solve, SOLVER_TOLERANCE_A)


def _compiled(folder: Path) -> Path:
    import cvxpy  # noqa: PLC0415 (an optional extra, and slow to import)
    from cvxpygen import cpg  # noqa: PLC0415 (an optional extra)

    current = cvxpy.Variable(name="current")
    reference, lower, upper = (
        cvxpy.Parameter(name=name) for name in ("reference", "lower", "upper")
    )
    objective = cvxpy.Minimize(cvxpy.square(current) - 2.0 * reference * current)
    program = cvxpy.Problem(objective, [current >= lower, current <= upper])
    before = Path.cwd()
    os.chdir(folder)  # the generator takes names of folders below the present one only
    try:
        with redirect_stdout(StringIO()):
            cpg.generate_code(program, code_dir=_FOLDER, solver="OSQP", wrapper=False)
    finally:
        os.chdir(before)
    code = folder / _FOLDER / "c"
    (folder / "loop.c").write_text(_LOOP, encoding="ascii")
    sources = [folder / "loop.c", code / "src" / "cpg_solve.c", code / "src" / "cpg_workspace.c"]
    sources += [code / "solver_code" / "workspace.c", *(code / "solver_code" / "src").glob("*.c")]
    includes = [code / "include", code / "solver_code", *(code / "solver_code" / "inc").iterdir()]
    command = [
        os.environ.get("CC", "cc"),
        *FLAGS,
        "-std=gnu99",
        "-shared",
        "-fPIC",
        *(f"-I{include}" for include in includes),
        *map(str, sources),
        "-lm",
        "-o",
        str(folder / "solver.so"),
    ]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "solver.so"
