"""Tries mutants of the C core on the tests of each source, and holds the survivors to the reviewed.

    python -m tests.firmware.mutants.run [SOURCE...] [--all] [--survivors] [--seed WORD]

A process that has loaded what the tests need beside the firmware forks for each mutant. A mutant is
killed by the first test that fails, by a crash, or by time. build/mutants.json keeps what was
found for each source; a source that has not changed since is not tried again. A survivor has to
stand in survivors.toml, with what makes it equivalent or harmless; else the run fails. With a seed
the sample is another one, of more kinds of changes, and nothing of it is kept.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from bms.native_build import FIRMWARE, ROOT
from hil_sim.studies.pack.native_build import PACK
from tests.firmware.mutants.build import Built, Factory, extension_of, sources_hash
from tests.firmware.mutants.generate import code_lines
from tests.firmware.mutation import CompiledFirmware
from tests.firmware.native_library import VARIANT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

HERE = Path(__file__).parent
KEPT = ROOT / "build" / "mutants.json"
LEFT_OUT = " and ".join(
    f"not {part}"
    for part in (
        "mutant",
        "emulat",
        "taken_away",
        "broken_rule",
        "without_its",
        "without_a_condition",
    )
)
"""Tests that build firmware of their own, or a board."""
_NOT_RUN = (
    pytest.ExitCode.INTERNAL_ERROR,
    pytest.ExitCode.USAGE_ERROR,
    pytest.ExitCode.NO_TESTS_COLLECTED,
)
NO_KEYS: frozenset[str] = frozenset()
PROFILE = "mutants"
HEAVY = (
    *("numpy", "scipy.optimize", "scipy.sparse", "cantools.autosar", "can", "osqp", "pydantic"),
    *("bms.model.pair", "bms.calibration", "codegen.can_database"),
)
"""What the tests import, but for the firmware and what imports it."""


@dataclass(frozen=True)
class Plan:
    """plan.toml: how many mutants of each source, and the tests for them."""

    per_line: float
    least: int
    longest_s: int
    tests: dict[str, list[str]]

    @classmethod
    def load(cls) -> Plan:
        return cls(**tomllib.loads((HERE / "plan.toml").read_text(encoding="utf-8")))

    def tests_of(self, sources: Iterable[str]) -> list[str]:
        """Every test of some sources, once."""
        return sorted({name for source in sources for name in self.tests[source]})

    def number(self, source: str) -> int:
        """How many mutants of a source are tried."""
        lines = (ROOT / source).read_text(encoding="utf-8").count("\n")
        return max(self.least, round(self.per_line * lines))


def prepare() -> None:
    """Load what every mutant's tests need, and have hypothesis look for no smallest example."""
    for name in HEAVY:
        importlib.import_module(name)
    register_profile()


def register_profile() -> None:
    """A profile of hypothesis that looks for no smallest example."""
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        PROFILE, deadline=None, phases=phases, database=None, derandomize=True
    )


def _file(name: str) -> str:
    """Test file of a name in the plan: one of the firmware, where no folder stands before."""
    folder, _, stem = name.rpartition("/")
    return f"tests/{folder or 'firmware'}/test_{stem}{'' if '::' in name else '.py'}"


def survives(built: Built | None, tests: Sequence[str], longest_s: int) -> bool:
    """Whether all tests pass with the mutant, or with none, in a process of its own.

    RuntimeError when they could not be run: that says nothing of the mutant.
    """
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        # Of processor time: other work on the machine kills no mutant.
        resource.setrlimit(resource.RLIMIT_CPU, (longest_s, longest_s))
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        if built is not None:
            os.environ[VARIANT] = str(built.source)
        options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "-k", LEFT_OUT]
        options += [f"--hypothesis-profile={PROFILE}"]
        if built is not None and built.extension is not None:
            if built.native is FIRMWARE:
                options += ["--firmware-build", str(built.extension)]
            else:
                built.native.load_build(built.extension)
        files = [_file(name) for name in tests]
        os._exit(int(pytest.main([*options, *files])))
    until = time.monotonic() + 20 * longest_s  # of one that waits for what does not come
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            if code in _NOT_RUN:
                raise RuntimeError(f"{', '.join(tests)}: pytest ended with {code}, no test was run")
            return code == 0
        time.sleep(0.01)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def try_source(
    source: str, factory: Factory, plan: Plan, number: int | None, only: frozenset[str] = NO_KEYS
) -> tuple[str, dict[str, Any]]:
    """What became of the drawn mutants of a source; of all of them without a number.

    With `only`, all but those count as killed without being tried.
    """
    killed, survivors, refuted, start_s = 0, [], [], time.monotonic()
    argued = reviewed_survivors()
    longest_s = plan.longest_s * len(plan.tests[source])
    for built in islice(factory.built(source), number):
        is_tried = not only or built.mutant.key in only
        if is_tried and survives(built, plan.tests[source], longest_s):
            survivors.append(built.mutant.key)
            print(f"survives: {source}:{built.mutant.line}: {built.mutant.key}", file=sys.stderr)
        else:
            killed += 1
            if is_tried and built.mutant.key in argued:
                refuted.append(built.mutant.key)
    took = f"{killed} killed, {len(survivors)} survive, {time.monotonic() - start_s:.0f} s"
    print(f"{source}: {took}", file=sys.stderr, flush=True)
    return source, {
        "sha256": sources_hash(source),
        "tried": killed + len(survivors),
        "killed": killed,
        "survivors": sorted(survivors),
        "refuted": sorted(refuted),
    }


def _try(task: tuple[str, Factory, Plan, int | None, frozenset[str]]) -> tuple[str, dict[str, Any]]:
    return try_source(*task)


def unreviewed(found: dict[str, Any], reviewed: dict[str, str]) -> list[str]:
    """Survivors that nobody has argued about, and arguments about mutants that are killed.

    An argument about a mutant that was not drawn stays, for as long as its line is in its source.
    """
    survivors = {key for entry in found.values() for key in entry["survivors"]}
    complaints = [
        f"no argument for the survivor {key}" for key in sorted(survivors - set(reviewed))
    ]
    refuted = {key for entry in found.values() for key in entry.get("refuted", ())}
    complaints += [f"{key} is argued about, but it is killed" for key in sorted(refuted)]
    complaints += [
        f"no words in the argument for {key}" for key, why in reviewed.items() if not why
    ]
    return complaints


def outdated(reviewed: dict[str, str], sources: Iterable[str], root: Path) -> list[str]:
    """Complaints about arguments for lines that their sources do not have any more."""
    lines = {Path(source).name: code_lines(root / source) for source in sources}
    complaints = []
    for key in reviewed:
        name, change = key.split(": ", 1)
        if change.split(" -> ")[0] not in lines.get(name, ()):
            complaints.append(f"{key} is argued about, but {name} has no such line")
    return complaints


def reviewed_survivors() -> dict[str, str]:
    """The reviewed list: the argument for each surviving mutant."""
    content = tomllib.loads((HERE / "survivors.toml").read_text(encoding="utf-8"))
    return {entry["mutant"]: entry["why"].strip() for entry in content.get("survivor", [])}


def kept() -> dict[str, Any]:
    """What earlier runs have found of each source, those that have not ended too."""
    found: dict[str, Any] = {}
    if KEPT.is_file():
        found = json.loads(KEPT.read_text(encoding="utf-8"))
    return found


def main() -> int:
    """Try the mutants of changed sources; 1 when a survivor is not in the reviewed list."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("sources", nargs="*", help="try these, changed or not")
    parser.add_argument("--all", action="store_true", help="every source, every mutant: hours")
    parser.add_argument("--survivors", action="store_true", help="try those again, no others")
    parser.add_argument("--seed", default="", help="another sample, of more kinds; it is not kept")
    parser.add_argument("--jobs", type=int, default=2, help="sources at a time")
    arguments = parser.parse_args()
    os.chdir(ROOT)
    plan, found = Plan.load(), {} if arguments.seed else kept()
    wanted = arguments.sources or [
        source
        for source in plan.tests
        if arguments.all or found.get(source, {}).get("sha256") != sources_hash(source)
    ]
    again = dict.fromkeys(wanted, NO_KEYS)
    if arguments.survivors:
        # Of a source that has changed since, nothing is known of the others any more.
        again = {
            source: frozenset(entry["survivors"])
            for source, entry in found.items()
            if entry["sha256"] == sources_hash(source)
        }
        wanted = [source for source in again if again[source]]
    wanted.sort(key=plan.number, reverse=True)
    prepare()
    with tempfile.TemporaryDirectory() as folder, get_context("fork").Pool(arguments.jobs) as pool:
        compiled = {
            native.module: CompiledFirmware.build(Path(folder) / native.module, native)
            for native in (FIRMWARE, PACK)
        }
        tests = plan.tests_of(wanted)
        if wanted and not survives(None, tests, plan.longest_s * len(tests)):
            print("mutants: the tests fail without any", file=sys.stderr)
            return 1
        natives = [extension_of(source) for source in wanted]
        factories = [
            Factory(compiled[native.module], Path(folder) / str(i), native, arguments.seed)
            for i, native in enumerate(natives)
        ]
        numbers = [None if arguments.all else plan.number(source) for source in wanted]
        keys = [again[source] for source in wanted]
        tasks = zip(wanted, factories, [plan] * len(wanted), numbers, keys)
        for source, entry in pool.imap_unordered(_try, tasks):
            found[source] = entry
            if arguments.seed:
                continue
            KEPT.parent.mkdir(exist_ok=True)
            KEPT.write_text(json.dumps(found), encoding="utf-8")
    found = {source: found[source] for source in plan.tests if source in found}
    reviewed = reviewed_survivors()
    complaints = unreviewed(found, reviewed) + outdated(reviewed, plan.tests, ROOT)
    for complaint in complaints:
        print(f"mutants: {complaint}", file=sys.stderr)
    tried = sum(entry["tried"] for entry in found.values())
    killed = sum(entry["killed"] for entry in found.values())
    print(json.dumps({"tried": tried, "killed": killed, "sources": found}, indent=1))
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main())
