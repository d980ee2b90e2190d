"""What the project wants to reach, beside what was measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hil_sim.studies.bench.race import Absent, Timed
from hil_sim.studies.bench.run import Result


@dataclass(frozen=True)
class Aim:
    """One of them; `unit` is "ns" for a time and "times" for a ratio."""

    name: str
    measured: float
    wanted: float
    unit: str

    @property
    def is_reached(self) -> bool:
        """Times in ns are to be short, ratios large."""
        if self.unit == "ns":
            return self.measured <= self.wanted
        return self.measured >= self.wanted


_SLOWER = (
    ("estimate", "KAN in pykan, one at a time", 1000.0),
    ("decision", "OSQP, warm update and solve", 100.0),
    ("decision", "OSQP, set-up and solve", 100.0),
    ("decision", "SciPy SLSQP", 5000.0),
)
_FASTEST_ns = 100.0
_BUS_AIMS = {"virtual": 300.0, "socketcan": 20.0}


def aims(result: Result) -> Iterator[Aim]:
    """The aims of the sections that were run."""
    if result.estimate and result.decision:
        both_ns = _in_c(result.estimate).time_ns.median + _in_c(result.decision).time_ns.median
        yield Aim("estimate plus decision in C", both_ns, _FASTEST_ns, "ns")
    for section, name, wanted in _SLOWER:
        rows: list[Timed | Absent] = getattr(result, section)
        for row in rows:
            if isinstance(row, Timed) and row.name == name:
                ratio = row.time_ns.median / _in_c(rows).time_ns.median
                yield Aim(f"{name}, over C", ratio, wanted, "times")
    for speed in result.simulation:
        interface = speed.bus.partition(":")[0]
        if speed.times_real_time is not None and interface in _BUS_AIMS:
            yield Aim(
                f"simulation on {speed.bus}",
                speed.times_real_time.median,
                _BUS_AIMS[interface],
                "times",
            )


def _in_c(rows: list[Timed | Absent]) -> Timed:
    first = rows[0]
    assert isinstance(first, Timed)
    return first
