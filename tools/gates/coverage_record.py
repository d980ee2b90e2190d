"""What the coverage gate holds: tests, shares, gaps of each file, exclusions and reasons."""

from __future__ import annotations

import fnmatch
import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

WAYS = ("true", "false", "alone")


class RecordError(Exception):
    """A record that cannot be used; the message says where and why."""


@dataclass(frozen=True)
class Gap:
    """One way of a branch, or one condition that never decided alone, that no test reached."""

    source: str
    line: int
    text: str
    way: str
    what: str

    def __str__(self) -> str:
        missing = "never decides alone" if self.way == "alone" else f"is never {self.way}"
        return f"{self.source}:{self.line}: {self.what} {missing}: {self.text.strip()}"


@dataclass(frozen=True)
class Exclusion:
    """Gaps that cannot be reached, by a text of their line; of `what` alone where it is given."""

    source: str
    line: str
    ways: tuple[str, ...]
    reason: str
    what: str = ""

    def covers(self, gap: Gap) -> bool:
        """Whether this is about that gap."""
        return (
            gap.source == self.source
            and self.line in gap.text
            and gap.way in self.ways
            and self.what in ("", gap.what)
        )


class Coverage(Protocol):
    """What was measured of a file."""

    @property
    def branches(self) -> Mapping[Any, tuple[bool, bool]]:
        """Both ways of each branch."""

    @property
    def conditions(self) -> Mapping[Any, list[bool]]:
        """For each decision, which of its conditions decided alone."""

    def gaps(self, source: str, text: list[str]) -> list[Gap]:
        """What was not reached."""


@dataclass(frozen=True)
class Record:
    """The content of tools/gates/coverage.toml."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]
    options: tuple[str, ...]
    least_branches: float
    least_mcdc: float
    open_conditions: Mapping[str, int]
    left_out: Mapping[str, str]
    exclusions: tuple[Exclusion, ...]

    def concerns(self, source: str) -> bool:
        """Whether a file is measured."""
        is_source = any(fnmatch.fnmatch(source, pattern) for pattern in self.sources)
        return is_source and source not in self.left_out

    def judge(self, found: Mapping[str, Coverage], root: Path) -> list[str]:
        """Complaints about a measurement, after a table of it on stdout."""
        complaints = [
            f"{source}: no test compiles it" for source in self._expected(root) - found.keys()
        ]
        stale, totals = set(self.exclusions), Counter[str]()
        print(f"{'':44s} {'branches':>14s} {'conditions':>14s} {'excluded':>9s}")
        for source, coverage in sorted(found.items()):
            text = (root / source).read_text(encoding="utf-8").splitlines()
            left, excluded = [], Counter[str]()
            for gap in coverage.gaps(source, text):
                reasons = [e for e in self.exclusions if e.covers(gap)]
                stale -= set(reasons)
                if reasons:
                    excluded["conditions" if gap.way == "alone" else "branches"] += 1
                else:
                    left.append(gap)
            conditions = [gap for gap in left if gap.way == "alone"]
            shares = {
                "branches": (len(left) - len(conditions), 2 * len(coverage.branches)),
                "conditions": (len(conditions), sum(map(len, coverage.conditions.values()))),
            }
            columns = []
            for kind, (missing, all_of_them) in shares.items():
                reachable = all_of_them - excluded[kind]
                totals[kind] += reachable
                totals[f"missing {kind}"] += missing
                columns.append(f"{reachable - missing:6d} /{reachable:6d}")
            print(f"{source:44s} {'  '.join(columns)} {excluded.total():9d}")
            complaints += self._of_file(source, left)
        complaints += self._of_totals(totals)
        complaints += [
            f"exclusion of '{e.line}' in {e.source} excludes nothing; remove it" for e in stale
        ]
        return complaints

    def _expected(self, root: Path) -> set[str]:
        paths = (path for pattern in self.sources for path in root.glob(pattern))
        names = {p.relative_to(root).as_posix() for p in paths if p.suffix == ".c"}
        return {name for name in names if self.concerns(name)}

    def _of_file(self, source: str, left: list[Gap]) -> list[str]:
        branches = [str(gap) for gap in left if gap.way != "alone"]
        conditions = [str(gap) for gap in left if gap.way == "alone"]
        recorded = self.open_conditions.get(source, 0)
        if len(conditions) > recorded:
            return [*branches, *conditions]
        if len(conditions) < recorded:
            better = f"{source}: {len(conditions)} open conditions, {recorded} in the record"
            return [*branches, f"{better}; lower it in tools/gates/coverage.toml"]
        return branches

    def _of_totals(self, totals: Counter[str]) -> list[str]:
        complaints = []
        least = {"branches": self.least_branches, "conditions": self.least_mcdc}
        for kind, floor in least.items():
            share = 100.0 * (1.0 - totals[f"missing {kind}"] / max(totals[kind], 1))
            print(f"{kind}: {share:.2f} % of {totals[kind]}, at least {floor:g} %")
            if share < floor:
                complaints.append(f"{kind}: {share:.2f} % reached, at least {floor:g} % wanted")
        return complaints


def load_record(path: Path) -> Record:
    """The record in a TOML file; RecordError when an entry is wrong or has no reason."""
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    exclusions = []
    for entry in content.get("excluded", []):
        exclusion = Exclusion(**{**entry, "ways": tuple(entry["ways"])})
        if not exclusion.reason.strip() or not set(exclusion.ways) <= set(WAYS):
            raise RecordError(f"{path}: '{exclusion.line}': needs a reason, and ways of {WAYS}")
        exclusions.append(exclusion)
    return Record(
        sources=tuple(content["sources"]),
        tests=tuple(content["tests"]),
        options=tuple(content["options"]),
        least_branches=content["least"]["branches"],
        least_mcdc=content["least"]["mcdc"],
        open_conditions=content.get("open_conditions", {}),
        left_out=content.get("left_out", {}),
        exclusions=tuple(exclusions),
    )
