"""What the instructions of a control period go to, function by function, from a trace of QEMU."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bms.errors import InputError
from hil_sim.targets import Emulation

TIMEOUT_S = 300.0
SEARCHING, WITHOUT_PLANNER = (20, 25), (170, 12)
"""Periods from the ECU's start, and how many of the last of them are averaged: all of them search
for a plan, or none of them does."""
_PERIOD = "whole_period"
_NM = "arm-none-eabi-nm"
_ADDRESS = re.compile(r"\[[0-9a-f]+/([0-9a-f]+)/")
_SUFFIX = re.compile(r"\.(lto_priv|constprop|part|isra)\b.*")


def instructions_by_function(
    program: Path, board: str, records: Sequence[bytes], last: int
) -> dict[str, float]:
    """Mean instructions of each function over the last periods of the records, most first.

    What the compiler took into a caller counts there. Raises InputError when the program is not
    built or does not end, or QEMU or the compiler's tools are missing.
    """
    periods = list(_periods(_addresses(program, board, records), _Functions(program)))[-last:]
    total = Counter[str]()
    for period in periods:
        total.update(period)
    return {name: count / len(periods) for name, count in total.most_common()}


class _Functions:
    """Names of functions by the addresses of their instructions."""

    def __init__(self, program: Path) -> None:
        if not program.is_file():
            raise InputError(f"{program}: not built; run 'make cost'")
        if shutil.which(_NM) is None:
            raise InputError(f"{_NM}: not found; run tools/debian_packages.sh firmware")
        listed = subprocess.run(
            [_NM, "--numeric-sort", str(program)], capture_output=True, text=True, check=True
        )
        rows = [line.split() for line in listed.stdout.splitlines()]
        code = [(int(row[0], 16), row[2]) for row in rows if len(row) == 3 and row[1] in "tT"]
        self._starts = [start for start, _ in code]
        self._names = [_SUFFIX.sub("", name) for _, name in code]

    def at(self, address: int) -> str:
        """Name of the function that the instruction at an address belongs to."""
        return self._names[bisect_right(self._starts, address) - 1]


def _periods(addresses: Iterable[int], functions: _Functions) -> Iterator[Counter[str]]:
    """Instructions by function of each control period, from its call to its return."""
    known: dict[int, str] = {}
    caller, before = "", ""
    period = Counter[str]()
    for address in addresses:
        name = known.get(address) or known.setdefault(address, functions.at(address))
        if not caller and name == _PERIOD:
            caller, period = before, Counter()
        if caller and name == caller:
            yield period
            caller = ""
        if caller:
            period[name] += 1
        before = name


def _addresses(program: Path, board: str, records: Sequence[bytes]) -> Iterator[int]:
    """Of every instruction that the counting program executes on the records."""
    with tempfile.TemporaryDirectory() as folder:
        inputs, trace = Path(folder) / "records", Path(folder) / "trace"
        inputs.write_bytes(b"".join(records))
        arguments = f"arg=cost,arg={inputs},arg={Path(folder) / 'ticks'}"
        tracing = ("-singlestep", "-d", "exec,nochain", "-D", str(trace))
        options = (*tracing, "-semihosting-config", f"enable=on,target=native,{arguments}")
        with Emulation(program, board, options=options) as emulation:
            if emulation.wait(TIMEOUT_S) != 0:
                raise InputError(f"{program}: has not ended well on {board}; build it anew")
        with trace.open(encoding="ascii", errors="replace") as lines:
            for line in lines:
                if found := _ADDRESS.search(line):
                    yield int(found[1], 16)
