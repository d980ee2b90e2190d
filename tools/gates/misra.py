"""MISRA C:2012 and cppcheck's own checks over the C core, held against recorded deviations.

    python -m tools.gates.misra [--list RULE]

cppcheck's addon knows the rules by number; tools/gates/misra.toml has, for each that is not kept
everywhere, how often, and why that is accepted. More than that fails, a rule that the record does
not know fails, and fewer do until the record is lowered.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from tools.gates.records import gates, keep

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "tools" / "gates" / "misra.toml"
AREAS = {
    "core": ("src", "image", "boot", "include"),
    "ports": ("port", "port/linux", "port/cortex_m"),
    "packs": ("pack", "pack_ecu"),
}
"""Folders of firmware_c by the name that the record has for them together."""
TOGETHER = (("core", "ports"), ("packs",))
"""Areas that are one program: what is said of names in several files is said within each."""
INCLUDED = (
    *("include", "src", "generated", "image", "boot", "port", "port/linux"),
    *("pack", "pack/generated", "pack_ecu"),
)
_LINE = re.compile(r"(?P<file>[^:]+):(?P<line>\d+): \w+ (?P<rule>[\w.-]+)$")
_MISRA = "misra-c2012-"


@dataclass(frozen=True)
class Violation:
    """Where a rule is not kept; `rule` is a number of MISRA C:2012 or a name of cppcheck's."""

    source: str
    line: int
    rule: str


def violations(tree: Path) -> list[Violation]:
    """What cppcheck finds in the sources of tree/firmware_c; CalledProcessError when it fails."""
    found = {one for areas in TOGETHER for one in _violations_of(tree, areas)}
    return sorted(found, key=lambda v: (v.rule, v.source, v.line))


def _violations_of(tree: Path, areas: Iterable[str]) -> Iterator[Violation]:
    core = tree / "firmware_c"
    folders = [core / folder for area in areas for folder in AREAS[area]]
    sources = [str(path) for folder in folders for path in sorted(folder.glob("*.c"))]
    if not sources:
        return
    command = ["cppcheck", "--addon=misra", "--std=c99", "-j", "2", "--quiet", "--template"]
    command += ["{file}:{line}: {severity} {id}", "--enable=warning,style,performance,portability"]
    command += ["--suppress=missingIncludeSystem", "--suppress=*:*/generated/*"]
    command += [f"-I{core / folder}" for folder in INCLUDED]
    done = subprocess.run([*command, *sources], check=True, capture_output=True, text=True)
    for line in done.stderr.splitlines():
        match = _LINE.match(line)
        if match is None:
            continue
        source = Path(match["file"]).resolve().relative_to(tree.resolve()).as_posix()
        if "/generated/" not in source and area_of(source) in areas:
            rule = match["rule"].removeprefix(_MISRA)
            yield Violation(source, int(match["line"]), rule)


def area_of(source: str) -> str:
    """Name of the area in which a source lies."""
    folder = Path(source).parent.relative_to("firmware_c").as_posix()
    return next(area for area, folders in AREAS.items() if folder in folders)


def complaints(found: Iterable[Violation], record: Mapping[str, Mapping[str, object]]) -> list[str]:
    """What differs from the record of deviations; empty when it is kept."""
    counts = Counter((v.rule, area_of(v.source)) for v in found)
    places = {(v.rule, area_of(v.source)): f"{v.source}:{v.line}" for v in found}
    wrong = []
    for rule, entry in record.items():
        if not str(entry.get("reason", "")).strip():
            wrong.append(f"deviation {rule} has no reason")
        for area in AREAS:
            counts.setdefault((rule, area), 0)
    for (rule, area), count in sorted(counts.items()):
        allowed = record.get(rule, {}).get(area, 0)
        assert isinstance(allowed, int)
        if count > allowed:
            place = f"the last at {places[rule, area]}"
            more = f"rule {rule} is broken {count} times in the {area}, {allowed} are recorded"
            wrong.append(f"{more}; {place}; see them with --list {rule}")
        elif count < allowed:
            fewer = f"rule {rule} is broken {count} times in the {area}, {allowed} are recorded"
            wrong.append(f"{fewer}; lower it in tools/gates/misra.toml")
    return wrong


def main() -> int:
    """Hold the sources against the record; 1 when they differ."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--list", metavar="RULE", help="show where this rule is not kept")
    arguments = parser.parse_args()
    if shutil.which("cppcheck") is None:
        print("not run: MISRA; it needs what tools/debian_packages.sh installs", file=sys.stderr)
        return int("CI" in os.environ)
    inputs_sha256 = gates()["misra"].inputs_sha256()
    found = violations(ROOT)
    if arguments.list is not None:
        for violation in found:
            if violation.rule == arguments.list:
                text = (ROOT / violation.source).read_text(encoding="utf-8").splitlines()
                print(f"{violation.source}:{violation.line}: {text[violation.line - 1].strip()}")
        return 0
    record = tomllib.loads(RECORD.read_text(encoding="utf-8"))["deviation"]
    wrong = complaints(found, record)
    for complaint in wrong:
        print(f"misra: {complaint}", file=sys.stderr)
    if not wrong:
        counts = Counter(f"{area_of(v.source)}: {v.rule}" for v in found)
        keep("misra", inputs_sha256, dict(sorted(counts.items())))
    print(f"{len(found)} recorded deviations from {len(record)} rules" if not wrong else "")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
