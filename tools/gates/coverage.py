"""Branch and MC/DC coverage of the C core and of what packs add by the selected tests, held against
a record.

    python -m tools.gates.coverage [--out FOLDER]

clang counts both ways of every branch and, of every decision with several conditions, which of
them changed the outcome on their own. tools/gates/coverage.toml has the tests, the least shares,
the number of gaps in each file, and what is excluded and why. A file with more gaps than its record
fails, and one with fewer does until the record is lowered.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.gates.coverage_record import Gap, Record, RecordError, load_record
from tools.gates.records import gates, keep

ROOT = Path(__file__).resolve().parents[2]
COMPILER = ROOT / "tools" / "gates" / "clang_coverage.sh"
RECORD = ROOT / "tools" / "gates" / "coverage.toml"
EXTENSIONS = {
    "bms.native_build.FIRMWARE": "",
    "hil_sim.studies.pack.native_build.PACK": (
        f"-fprofile-list={ROOT / 'tools' / 'gates' / 'coverage_packs.list'}"
    ),
}
"""What is built, and the compiler's flags for it. Of the packs' nothing of the core is counted."""
Place = tuple[int, int, int, int]


@dataclass
class FileCoverage:
    """What the tests reached of one file; places are (line, column, end line, end column)."""

    branches: dict[Place, tuple[bool, bool]] = field(default_factory=dict)
    conditions: dict[Place, list[bool]] = field(default_factory=dict)

    def add_branch(self, place: Place, taken: bool, not_taken: bool) -> None:
        """Several copies of an inline function count as one."""
        before = self.branches.get(place, (False, False))
        self.branches[place] = (before[0] or taken, before[1] or not_taken)

    def add_decision(self, place: Place, covered: list[bool]) -> None:
        """Several copies of an inline function count as one."""
        before = self.conditions.get(place, [False] * len(covered))
        self.conditions[place] = [a or b for a, b in zip(before, covered, strict=True)]

    def numbers(self) -> dict[str, int]:
        """Ways of branches and conditions, and how many of them the tests reach."""
        ways = [way for both in self.branches.values() for way in both]
        conditions = [reached for each in self.conditions.values() for reached in each]
        return {
            "ways": len(ways),
            "ways_reached": sum(ways),
            "conditions": len(conditions),
            "conditions_reached": sum(conditions),
        }

    def gaps(self, source: str, text: list[str]) -> list[Gap]:
        """Every way of a branch and every condition that the tests did not reach."""
        found = []
        for (line, column, _, end), ways in sorted(self.branches.items()):
            for way, reached in zip(("true", "false"), ways, strict=True):
                if not reached:
                    what = text[line - 1][column - 1 : end - 1] or text[line - 1].strip()
                    found.append(Gap(source, line, text[line - 1], way, what))
        for (line, *_), covered in sorted(self.conditions.items()):
            for index, reached in enumerate(covered):
                if not reached:
                    what = f"condition {index + 1} of {len(covered)}"
                    found.append(Gap(source, line, text[line - 1], "alone", what))
        return found


def build_extensions(out: Path) -> list[Path]:
    """The extensions of firmware and packs, made by the coverage compiler."""
    built = []
    for native, flags in EXTENSIONS.items():
        environment = {**os.environ, "CC": str(COMPILER), "LDSHARED": f"{COMPILER} -shared"}
        environment["CFLAGS"] = flags
        module, _, name = native.rpartition(".")
        program = (
            f"import pathlib, sys; from {module} import {name} as native; "
            "print(native.builder(tree=pathlib.Path(sys.argv[1])).compile(tmpdir=sys.argv[2]))"
        )
        command = [sys.executable, "-c", program, str(ROOT), str(out)]
        done = subprocess.run(
            command, cwd=ROOT, env=environment, check=True, stdout=subprocess.PIPE
        )
        built.append(Path(done.stdout.decode().strip().splitlines()[-1]))
    return built


def run_tests(record: Record, out: Path) -> None:
    """Run the selected tests; CalledProcessError when one fails."""
    environment = {
        **os.environ,
        "CC": str(COMPILER),
        "LLVM_PROFILE_FILE": str(out / "raw" / "%p-%m.profraw"),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "loadfile"]
    command += ["-p", "no:cacheprovider", "--hypothesis-seed=0", "--no-header"]
    for option in ("--firmware-build", "--pack-build"):
        command += [option, str(out / "extension")]
    command += ["--basetemp", str(out / "tests")]
    command += [*record.options, *record.tests]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)


def export(libraries: Iterable[Path], out: Path) -> dict[str, Any]:
    """What llvm-cov says of all libraries together."""
    profiles = sorted((out / "raw").glob("*.profraw"))
    listed = out / "profiles.txt"
    listed.write_text("\n".join(map(str, profiles)) + "\n", encoding="utf-8")
    merged = out / "merged.profdata"
    command = ["llvm-profdata-19", "merge", "-sparse", "-f", str(listed), "-o", str(merged)]
    subprocess.run(command, check=True)
    objects = [word for path in libraries for word in ("-object", str(path))]
    command = ["llvm-cov-19", "export", "-instr-profile", str(merged), *objects]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    content: dict[str, Any] = json.loads(done.stdout)
    return content


def coverage_of(content: dict[str, Any], record: Record) -> dict[str, FileCoverage]:
    """Coverage of each source of the record by its path in the repository."""
    found: dict[str, FileCoverage] = {}
    for entry in content["data"][0]["files"]:
        path = Path(entry["filename"])
        if not path.is_relative_to(ROOT):
            continue
        source = path.relative_to(ROOT).as_posix()
        if not record.concerns(source):
            continue
        coverage = found.setdefault(source, FileCoverage())
        for line, column, end_line, end, taken, not_taken, *_ in entry["branches"]:
            coverage.add_branch((line, column, end_line, end), taken > 0, not_taken > 0)
        for line, column, end_line, end, *_, covered in entry["mcdc_records"]:
            coverage.add_decision((line, column, end_line, end), covered)
    return found


def measure(record: Record, out: Path) -> dict[str, FileCoverage]:
    """Build, run the tests, and read what they reached."""
    shutil.rmtree(out, ignore_errors=True)
    (out / "raw").mkdir(parents=True)
    extensions = build_extensions(out / "extension")
    run_tests(record, out)
    libraries = [*extensions, *sorted((out / "tests").rglob("*.so"))]
    return coverage_of(export(libraries, out), record)


def main() -> int:
    """Measure and hold against the record; 1 when it is not kept."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "coverage")
    arguments = parser.parse_args()
    if shutil.which("clang-19") is None or shutil.which("llvm-cov-19") is None:
        print("not run: coverage; it needs what tools/debian_packages.sh installs", file=sys.stderr)
        return int("CI" in os.environ)
    try:
        record, inputs_sha256 = load_record(RECORD), gates()["coverage"].inputs_sha256()
        found = measure(record, arguments.out.resolve())
        complaints = record.judge(found, ROOT)
        if not complaints:
            numbers = {source: coverage.numbers() for source, coverage in sorted(found.items())}
            keep("coverage", inputs_sha256, numbers)
    except RecordError as error:
        complaints = [str(error)]
    for complaint in complaints:
        print(f"coverage: {complaint}", file=sys.stderr)
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main())
