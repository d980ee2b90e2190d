"""A benchmark's result as JSON, with units in the keys."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from hil_sim.studies.bench.aims import aims
from hil_sim.studies.bench.limits import breakdowns
from hil_sim.studies.bench.race import Absent, Quartiles, Timed
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.simulation import BusSpeed
from hil_sim.studies.bench.throughput import growth

_UNITS = {"estimate": "K", "perceptron": "normalised", "decision": "A", "period": "A"}


def outcome_json(result: Result) -> dict[str, Any]:
    """Every figure; sections that were not run are empty lists."""
    ways = {section: _ways(getattr(result, section), unit) for section, unit in _UNITS.items()}
    return {
        "machine": asdict(result.machine),
        "pinned_to_core": result.core,
        "threads": 1,
        "states": result.states,
        **ways,
        "simulation": [_bus(speed) for speed in result.simulation],
        "campaign": [
            {**asdict(row), "time_a_run_relative_to_first": relative}
            for row, relative in zip(result.campaign, growth(result.campaign))
        ],
        "board": [asdict(cost) for cost in result.board],
        "breakdowns": [
            {**asdict(one), "total": one.total, "is_enough": one.total <= one.wanted}
            for one in breakdowns(result)
        ],
        "period_not_counted": result.period_not_counted,
        "aims": [{**asdict(aim), "is_reached": aim.is_reached} for aim in aims(result)],
    }


def _ways(rows: list[Timed | Absent], unit: str) -> list[dict[str, Any]]:
    return [
        {"name": row.name, "not_run": row.reason} if isinstance(row, Absent) else _way(row, unit)
        for row in rows
    ]


def _way(row: Timed, unit: str) -> dict[str, Any]:
    return {
        "name": row.name,
        "package": row.package,
        **_quartiles(row.time_ns, "time", "ns"),
        "answers_a_repetition": row.answers,
        f"largest_difference_{unit}": row.largest_difference,
    }


def _bus(speed: BusSpeed) -> dict[str, Any]:
    if speed.times_real_time is None:
        return {"bus": speed.bus, "parties": speed.parties, "not_run": speed.not_run}
    return {
        "bus": speed.bus,
        "parties": speed.parties,
        "periods": speed.periods,
        **_quartiles(speed.times_real_time, "speed", "times_real_time"),
        "processor_share_percent": speed.processor_share_percent,
        "layer_shares_percent": speed.layer_shares_percent,
    }


def _quartiles(quartiles: Quartiles, name: str, unit: str) -> dict[str, Any]:
    return {
        f"median_{name}_{unit}": quartiles.median,
        f"lower_quartile_{name}_{unit}": quartiles.low,
        f"upper_quartile_{name}_{unit}": quartiles.high,
        "repetitions": quartiles.repetitions,
    }
