"""Writes the tables of docs/benchmarks.md and docs/cost.md from what the commands measured.

    bms bench --json > docs/assets/bench.json     # on a machine that does nothing else
    python -m tools.benchmark_page

A table stands between `<!-- NAME -->` and `<!-- end of NAME -->`. Those of flash come from
firmware_c/figures.json, the sizes of the last accepted build.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hil_sim.studies.bench.aims import aims
from hil_sim.studies.bench.board import board_flash
from hil_sim.studies.bench.limits import breakdowns
from hil_sim.studies.bench.machine import this_machine
from hil_sim.studies.bench.run import Result

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "docs" / "assets" / "bench.json"
BENCHMARKS, COST = ROOT / "docs" / "benchmarks.md", ROOT / "docs" / "cost.md"
BOARDS = ("mps2-an386", "mps2-an385")
_QUICK = " A quick run: few repetitions, 20 s of each charge on a bus."
_SECTIONS = ("estimate", "perceptron", "decision", "period")
_UNITS = {"times": "x", "us a period": "µs a period"}


def with_tables(page: str, tables: Mapping[str, str]) -> str:
    """The page with other tables; ValueError where it has no place for one."""
    for name, table in tables.items():
        place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
        found = list(place.finditer(page))
        if len(found) != 1:
            raise ValueError(f"no single place for the table '{name}'; mark one by <!-- {name} -->")
        begin, end = found[0].end(1), found[0].start(2)
        page = f"{page[:begin]}\n{table}\n\n{page[end:]}"
    return page


def benchmark_tables(result: Mapping[str, Any]) -> dict[str, str]:
    """Tables of docs/benchmarks.md by name, from what `bms bench --json` said."""
    parts: dict[str, Callable[[Mapping[str, Any]], str]] = {
        "machine": _machine,
        "ways": _ways,
        "simulation": _simulation,
        "campaign": _campaign,
        "parts": lambda said: "\n\n".join(map(_parts, said["breakdowns"])),
        "aims": _aims,
    }
    return {name: make(result) for name, make in parts.items()}


def cost_tables() -> dict[str, str]:
    """Tables of docs/cost.md that follow from the accepted sizes."""
    result = Result(this_machine(), board=[board_flash(board) for board in BOARDS])
    flash = [vars(one) | {"total": one.total} for one in breakdowns(result)]
    rows = [vars(aim) | {"is_reached": aim.is_reached} for aim in aims(result)]
    return {"flash": "\n\n".join(map(_parts, flash)) + "\n\n" + _aims({"aims": rows})}


def _table(*rows: tuple[str, ...]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def _machine(said: Mapping[str, Any]) -> str:
    machine = said["machine"]
    ways = [way for section in _SECTIONS for way in said[section] if "package" in way]
    packages = ", ".join(dict.fromkeys(way["package"] for way in ways))
    return (
        f"{machine['cpu']} with {machine['cores']} cores, {machine['system']}, Python "
        f"{machine['python']}; load average at the start {machine['load_average']:g}; "
        f"{said['states']:,} states; {packages}.{_QUICK if said['quick'] else ''}"
    )


def _time(time_ns: float) -> str:
    value, unit = (time_ns, "ns") if time_ns < 1000.0 else (time_ns / 1000.0, "µs")
    return f"{value:,.0f} {unit}" if value >= 100.0 else f"{value:.3g} {unit}"


def _ways(said: Mapping[str, Any]) -> str:
    rows = [("", "median", "quartiles", "times C")]
    c_ns = None
    for section in _SECTIONS:
        for number, way in enumerate(said[section]):
            if "not_run" in way:
                continue
            median_ns = way["median_time_ns"]
            c_ns = median_ns if number == 0 and section != "perceptron" else c_ns
            low, high = way["lower_quartile_time_ns"], way["upper_quartile_time_ns"]
            ratio = median_ns / c_ns if c_ns else 1.0
            shown = f"{ratio:,.0f}" if ratio >= 10.0 else f"{ratio:.2g}"
            row = f"{section}: {way['name']}"
            rows.append((row, _time(median_ns), f"{_time(low)} .. {_time(high)}", shown))
    return _table(*rows)


def _simulation(said: Mapping[str, Any]) -> str:
    rows = [("bus", "parties", "times real time", "quartiles", "processor")]
    for bus in said["simulation"]:
        if "not_run" in bus:
            rows.append((f"`{bus['bus']}`", bus["parties"], "not run", bus["not_run"], ""))
            continue
        median, low, high = (
            bus[f"{which}_speed_times_real_time"]
            for which in ("median", "lower_quartile", "upper_quartile")
        )
        share = f"{bus['processor_share_percent']:.0f} %"
        quartiles = f"{low:.0f} .. {high:.0f}"
        rows.append((f"`{bus['bus']}`", bus["parties"], f"{median:.0f}", quartiles, share))
    return _table(*rows)


def _campaign(said: Mapping[str, Any]) -> str:
    rows = [("runs", "runs a second", "a run takes, to the first", "wall time", "processes")]
    for row in said["campaign"]:
        relative = f"{row['time_a_run_relative_to_first']:.2f}"
        times = (f"{row['runs_per_s']:.1f}", relative, f"{row['wall_time_s']:.0f} s")
        rows.append((f"{row['runs']:,}", *times, str(row["jobs"])))
    return _table(*rows)


def _parts(one: Mapping[str, Any]) -> str:
    digits = 0 if one["measured"] >= 1000 else 1
    unit = _UNITS.get(one["unit"], one["unit"])
    rows = [(f"{one['figure']}: {unit}", "", "%")]
    for name, value in one["parts"].items():
        share = f"{100.0 * value / one['measured']:.0f}"
        rows.append((name, f"{value:,.{digits}f}", share))
    rows.append(("**all**", f"**{one['total']:,.{digits}f}**", "100"))
    rows.append(("asked", f"{one['wanted']:,.{digits}f}", ""))
    limit = one["limit"][0].upper() + one["limit"][1:].replace(" us", " µs")
    return f"{_table(*rows)}\n\n{limit}."


def _aims(said: Mapping[str, Any]) -> str:
    rows = [("", "measured", "wanted", "")]
    for aim in said["aims"]:
        unit = _UNITS.get(aim["unit"], aim["unit"])
        sign = "at most" if aim["unit"] in ("ns", "instructions", "B") else "at least"
        reached = "reached" if aim["is_reached"] else "missed"
        measured, wanted = f"{aim['measured']:,.0f} {unit}", f"{sign} {aim['wanted']:,.0f} {unit}"
        rows.append((aim["name"], measured, wanted, reached))
    return _table(*rows)


def pages() -> dict[Path, str]:
    """What the pages have to say."""
    said = json.loads(KEPT.read_text(encoding="utf-8"))
    return {
        BENCHMARKS: with_tables(BENCHMARKS.read_text(encoding="utf-8"), benchmark_tables(said)),
        COST: with_tables(COST.read_text(encoding="utf-8"), cost_tables()),
    }


def main() -> int:
    """Write the pages anew."""
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
