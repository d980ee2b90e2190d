"""Collects what was recorded, and holds each record to the sources that lie here now.

Nothing is measured anew and nothing is taken for granted: a record rests on files whose hash it
has, and is current where these are the files of now, stale where they are others.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bms import __version__
from bms.errors import InputError
from bms.firmware.image_header import FIRMWARE_VERSION
from bms.native_build import ROOT
from hil_sim.evidence.kept import GATES, LONG_CHECKS, KeptCheck, mutants_hash
from hil_sim.evidence.trace import REQUIREMENTS, load_requirements

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CURRENT, STALE, MISSING, INCOMPLETE = "current", "stale", "missing", "incomplete"
MUTANTS = Path("build/mutants.json")
SURVIVORS = Path("tests/firmware/mutants/survivors.toml")
PLAN = Path("tests/firmware/mutants/plan.toml")
MATRIX = Path("hil_sim/fault_matrix/matrix.toml")
SOURCES = ("firmware_c/**/*.[ch]", "bms/presets/*.toml", "bms/models/*.json", "codegen/can/*.dbc")
_CONTROLLER = "kan-rcbf"
TOOLS: Mapping[str, tuple[str, ...]] = {
    "Python": (sys.executable, "--version"),
    "gcc": ("gcc", "--version"),
    "arm-none-eabi-gcc": ("arm-none-eabi-gcc", "--version"),
    "clang": ("clang-19", "--version"),
    "cppcheck": ("cppcheck", "--version"),
    "QEMU": ("qemu-system-arm", "--version"),
}


@dataclass(frozen=True)
class Item:
    """A piece of evidence: whether it holds for the present sources, its numbers, its records."""

    name: str
    state: str
    says: str
    numbers: Any = None
    records: tuple[Path, ...] = ()
    remedy: str = ""


@dataclass(frozen=True)
class Section:
    """Items under one heading; `text` says what they are."""

    title: str
    text: str
    items: tuple[Item, ...]


@dataclass(frozen=True)
class Evidence:
    """All of it, with the versions and hashes of what it is about."""

    sections: tuple[Section, ...]
    versions: Mapping[str, str]
    tools: Mapping[str, str]
    sources: Mapping[str, str]
    root: Path = field(compare=False)

    def open_items(self) -> list[tuple[str, Item]]:
        """Section and item of all that is not there or not for these sources."""
        return [(s.title, i) for s in self.sections for i in s.items if i.state != CURRENT]

    def records(self) -> dict[str, bytes]:
        """Every record by its path in the repository."""
        paths = {
            path for section in self.sections for item in section.items for path in item.records
        }
        return {path.as_posix(): (self.root / path).read_bytes() for path in sorted(paths)}

    def as_json(self, date: str | None) -> dict[str, Any]:
        """Everything, each record by its hash."""
        hashes = {path: _sha256(content) for path, content in self.records().items()}
        return {
            "date": date,
            "versions": dict(self.versions),
            "tools": dict(self.tools),
            "complete": not self.open_items(),
            "sections": [
                {
                    "title": section.title,
                    "items": [
                        {
                            "name": item.name,
                            "state": item.state,
                            "says": item.says,
                            "remedy": item.remedy,
                            "numbers": item.numbers,
                            "records": {p.as_posix(): hashes[p.as_posix()] for p in item.records},
                        }
                        for item in section.items
                    ],
                }
                for section in self.sections
            ],
            "sources": dict(self.sources),
        }


def require_checkout(root: Path = ROOT) -> None:
    """Raise InputError unless the records can lie here."""
    if not all((root / path).exists() for path in (LONG_CHECKS, GATES, REQUIREMENTS, PLAN)):
        raise InputError(
            f"{root}: has no records, as an installed package has none; run "
            "'bms evidence --out DIR' in a checkout of the repository"
        )


def collect(root: Path = ROOT) -> Evidence:
    """What is recorded below a checkout; InputError for a record that cannot be read."""
    require_checkout(root)
    try:
        long = {check.name: check for check in KeptCheck.load(root, LONG_CHECKS)}
        gates = {check.name: check for check in KeptCheck.load(root, GATES)}
        sections = tuple(_sections(root, long, gates))
    except (ValueError, LookupError, TypeError, AttributeError, OSError) as error:
        raise InputError(f"{root}: a record cannot be read ({error}); make it anew") from None
    versions = {"package": __version__, "firmware": str(FIRMWARE_VERSION)}
    sources = {
        path.relative_to(root).as_posix(): _sha256(path.read_bytes())
        for pattern in SOURCES
        for path in sorted(root.glob(pattern))
    }
    return Evidence(sections, versions, dict(_tools()), sources, root)


def _sections(
    root: Path, long: Mapping[str, KeptCheck], gates: Mapping[str, KeptCheck]
) -> Iterator[Section]:
    yield Section(
        "Requirements",
        "Each is traced to a goal, to code, and to tests or kept results. A reference holds when "
        "its text stands in its file.",
        tuple(_requirements(root)),
    )
    yield Section(
        "Coverage",
        "Both ways of every branch, and each condition alone (MC/DC), that the tests reach in C.",
        (_kept(root, gates["coverage"], "make coverage", _coverage_says),),
    )
    yield Section("Mutants", "Changed sources that the tests notice.", tuple(_mutants(root)))
    yield Section(
        "Proofs",
        "Claims that CBMC shows for every input.",
        (_kept(root, long["proofs"], "make proofs", _proofs_say),),
    )
    misra = _kept(root, gates["misra"], "make misra", _misra_says)
    deviations = Path("tools/gates/misra.toml")
    yield Section(
        "MISRA C:2012",
        "Places that do not keep a rule; the reason for each rule is in the record of deviations.",
        (Item(**{**vars(misra), "records": (*misra.records, deviations)}),),
    )
    yield Section(
        "Fault matrix", "What the firmware does with each fault.", tuple(_matrix(root, long))
    )
    records = "python -m tools.gates.records"
    yield Section(
        "Budgets",
        "Bytes of flash, RAM and stack, and instructions, on both boards.",
        (
            _kept(root, gates["budgets"], f"{records} budgets", _budgets_say),
            _kept(root, gates["instructions"], f"{records} instructions", _instructions_say),
        ),
    )
    yield Section(
        "Certificates",
        "Interval proofs that each decision keeps every limit until the next one.",
        (_kept(root, gates["certificates"], f"{records} certificates", _certificates_say),),
    )
    shown = {"proofs", "three-places", "long-faults"}
    yield Section(
        "Campaigns and long checks",
        "What takes too long for every run of the tests.",
        tuple(
            _kept(root, check, f"make long-checks CHECKS={name}", _long_says)
            for name, check in long.items()
            if name not in shown
        ),
    )


def _kept(root: Path, check: KeptCheck, remedy: str, says: Callable[[Any], str]) -> Item:
    result = check.result(root)
    if result is None:
        return Item(check.name, MISSING, "not recorded here", remedy=remedy)
    current = check.is_current(root)
    return Item(
        check.name,
        CURRENT if current else STALE,
        says(result["said"]),
        result["said"],
        (check.path,),
        "" if current else remedy,
    )


def _requirements(root: Path) -> Iterator[Item]:
    for requirement in load_requirements(root):
        gone = [r for r in requirement.references if not r.is_there(root)]
        tests = len(requirement.tests)
        is_held = not gone and requirement.goals
        numbers = {
            "goals": list(requirement.goals),
            "references": [f"{r.path}: {r.keyword}" for r in requirement.references],
            "gone": [f"{r.path}: {r.keyword}" for r in gone],
        }
        says = f"{requirement.header}; {', '.join(requirement.goals)}; {tests} tests"
        yield Item(
            requirement.name,
            CURRENT if is_held else INCOMPLETE,
            says if not gone else f"{says}; {len(gone)} references lead nowhere",
            numbers,
            (REQUIREMENTS / f"{requirement.name}.yml",),
            "" if is_held else "mend the references, then 'doorstop review all'",
        )


def _mutants(root: Path) -> Iterator[Item]:
    remedy = "make mutants"
    plan = tomllib.loads((root / PLAN).read_text(encoding="utf-8"))
    argued = tomllib.loads((root / SURVIVORS).read_text(encoding="utf-8")).get("survivor", [])
    reasons = {entry["mutant"]: entry["why"] for entry in argued}
    kept = root / MUTANTS
    found = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    for source in plan["tests"]:
        entry = found.get(source)
        if entry is None:
            yield Item(source, MISSING, "not tried here", remedy=remedy)
            continue
        current = entry["sha256"] == mutants_hash(root, source)
        unargued = [key for key in entry["survivors"] if key not in reasons]
        says = f"{entry['killed']} of {entry['tried']} killed, {len(entry['survivors'])} survive"
        if unargued:
            says += f", {len(unargued)} without an argument"
        state = STALE if not current else INCOMPLETE if unargued else CURRENT
        numbers = {**entry, "arguments": {k: reasons.get(k) for k in entry["survivors"]}}
        yield Item(
            source, state, says, numbers, (MUTANTS, SURVIVORS), "" if state == CURRENT else remedy
        )


def _matrix(root: Path, long: Mapping[str, KeptCheck]) -> Iterator[Item]:
    rows = tomllib.loads((root / MATRIX).read_text(encoding="utf-8"))["row"]
    places = _kept(root, long["three-places"], "make three-places", _places_say)
    numbers = {"rows": [row["name"] for row in rows], "said": places.numbers}
    records = (*places.records, MATRIX)
    says = f"{len(rows)} rows; {places.says}"
    yield Item(**{**vars(places), "numbers": numbers, "records": records, "says": says})
    yield _kept(root, long["long-faults"], "make long-checks CHECKS=long-faults", _long_says)


# --- A line about what a check said --------------------------------------------------------------


def _coverage_says(said: Mapping[str, Mapping[str, int]]) -> str:
    total = {key: sum(n[key] for n in said.values()) for key in next(iter(said.values()))}
    return (
        f"{total['ways_reached']} of {total['ways']} ways of branches, "
        f"{total['conditions_reached']} of {total['conditions']} conditions, {len(said)} files"
    )


def _proofs_say(said: Mapping[str, Any]) -> str:
    return f"{said['all']} claims in {len(said['properties'])} harnesses hold"


def _misra_says(said: Mapping[str, int]) -> str:
    rules = {key.split(": ")[1] for key in said}
    return f"{sum(said.values())} recorded deviations from {len(rules)} rules"


def _budgets_say(said: Mapping[str, Any]) -> str:
    return "; ".join(
        f"{board}: {f['image']['flash']} bytes of flash, {f['image']['ram']} of RAM, "
        f"{f['core']['stack']} of stack in the core"
        for board, f in sorted(said.items())
    )


def _certificates_say(said: Mapping[str, Any]) -> str:
    return "; ".join(
        f"{preset} {'certified' if found['certified'] else 'NOT certified'}"
        for preset, found in said.items()
    )


def _places_say(said: Mapping[str, Any]) -> str:
    equal = "the same bytes on" if said["equal"] else "NOT the same bytes on"
    return f"{equal} host, native process and both boards in {len(said['scenarios'])} scenarios"


def _instructions_say(said: Sequence[Any]) -> str:
    return f"counted on {len(said)} boards"


def _long_says(said: Any) -> str:
    """Of words the line that counts; of numbers, those that an assessor looks for."""
    if isinstance(said, list):
        lines = [line for line in said if line.strip()]
        return str(next((line for line in lines if line.startswith("run ")), lines[-1]))
    if "charges" in said:
        return f"{len(said['charges'])} charges"
    groups = said.get("classes") or {"all": said}
    parts = []
    for name, group in groups.items():
        violations = group["controllers"][_CONTROLLER]["violations"]
        counts = ", ".join(f"{limit} {found['count']}" for limit, found in violations.items())
        parts.append(f"{name}, {group['runs']} charges: {counts}")
    return f"violations by {_CONTROLLER} with {said['preset']}; " + "; ".join(parts)


def _tools() -> Iterator[tuple[str, str]]:
    for name, command in TOOLS.items():
        if shutil.which(command[0]) is None:
            yield name, "not installed here"
            continue
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        yield name, (done.stdout.strip().splitlines() or ["says no version"])[0]


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
