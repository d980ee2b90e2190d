"""What the gates of the C core refuse: seeded gaps and violations, records that are too good."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from tests.firmware.mutants.generate import mutants_of
from tests.firmware.mutants.run import outdated, unreviewed
from tools.gates.coverage import RECORD as COVERAGE_RECORD
from tools.gates.coverage import FileCoverage
from tools.gates.coverage_record import Exclusion, Record, RecordError, load_record
from tools.gates.misra import Violation, complaints, violations

SOURCE = "firmware_c/src/part.c"
TEXT = "if (a && b) {\n    while (true) {\n"
LINE_1, LINE_2 = (1, 5, 1, 11), (2, 12, 2, 16)
needs_cppcheck = pytest.mark.skipif(
    shutil.which("cppcheck") is None and "CI" not in os.environ,
    reason="not run: cppcheck is not installed",
)


def record(**changes: object) -> Record:
    values: dict[str, object] = {
        "sources": ("firmware_c/src/*.[ch]",),
        "tests": (),
        "options": (),
        "least_branches": 100.0,
        "least_mcdc": 50.0,
        "open_conditions": {},
        "left_out": {},
        "exclusions": (),
    }
    return Record(**{**values, **changes})  # type: ignore[arg-type]


def measured(conditions: list[bool], endless: bool = True) -> dict[str, FileCoverage]:
    coverage = FileCoverage()
    coverage.add_branch(LINE_1, True, True)
    coverage.add_branch(LINE_2, True, not endless)
    coverage.add_decision(LINE_1, conditions)
    return {SOURCE: coverage}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "firmware_c" / "src").mkdir(parents=True)
    (tmp_path / SOURCE).write_text(TEXT)
    return tmp_path


ENDLESS = Exclusion(SOURCE, "while (true)", ("false",), "it never ends")


def test_a_way_that_no_test_takes_fails_and_an_exclusion_admits_it(tree: Path) -> None:
    (gap, share) = record().judge(measured([True, True]), tree)
    assert gap == f"{SOURCE}:2: true is never false: while (true) {{"
    assert share == "branches: 75.00 % reached, at least 100 % wanted"
    assert record(exclusions=(ENDLESS,)).judge(measured([True, True]), tree) == []


def test_an_exclusion_that_excludes_nothing_fails(tree: Path) -> None:
    kept = measured([True, True], endless=False)
    (stale,) = record(exclusions=(ENDLESS,)).judge(kept, tree)
    assert stale == f"exclusion of 'while (true)' in {SOURCE} excludes nothing; remove it"


def test_open_conditions_are_as_many_as_recorded_and_no_fewer(tree: Path) -> None:
    gap = measured([True, False], endless=False)
    (more,) = record().judge(gap, tree)
    assert more == f"{SOURCE}:1: condition 2 of 2 never decides alone: if (a && b) {{"
    assert record(open_conditions={SOURCE: 1}).judge(gap, tree) == []
    (fewer,) = record(open_conditions={SOURCE: 2}).judge(gap, tree)
    assert fewer.endswith("lower it in tools/gates/coverage.toml")


def test_a_share_below_the_least_fails_though_it_is_recorded(tree: Path) -> None:
    gap = measured([True, False], endless=False)
    strict = record(open_conditions={SOURCE: 1}, least_mcdc=51.0)
    (share,) = strict.judge(gap, tree)
    assert share == "conditions: 50.00 % reached, at least 51 % wanted"


def test_copies_of_an_inline_function_count_together(tree: Path) -> None:
    coverage = FileCoverage()
    for ways, conditions in (((True, False), [True, False]), ((False, True), [False, True])):
        coverage.add_branch(LINE_1, *ways)
        coverage.add_decision(LINE_1, conditions)
    assert record().judge({SOURCE: coverage}, tree) == []


def test_a_source_that_no_test_compiles_fails(tree: Path) -> None:
    (tree / "firmware_c" / "src" / "new.c").write_text("")
    (missing,) = record().judge(measured([True, True], endless=False), tree)
    assert missing == "firmware_c/src/new.c: no test compiles it"


def test_an_exclusion_without_a_reason_is_refused(tmp_path: Path) -> None:
    text = COVERAGE_RECORD.read_text(encoding="utf-8")
    entry = f'\n[[excluded]]\nsource = "{SOURCE}"\nline = "x"\nways = ["false"]\nreason = " "\n'
    (tmp_path / "coverage.toml").write_text(text + entry, encoding="utf-8")
    with pytest.raises(RecordError, match="'x': needs a reason"):
        load_record(tmp_path / "coverage.toml")


CLEAN = "static int twice(int a)\n{\n    return 2 * a;\n}\nint four(void);\n" + (
    "int four(void)\n{\n    return twice(2);\n}\n"
)
GOTO = CLEAN.replace("    return twice(2);", "    goto end;\nend:\n    return twice(2);")


def found(tree: Path, text: str) -> list[Violation]:
    (tree / SOURCE).write_text(text)
    return violations(tree)


@needs_cppcheck
def test_a_seeded_violation_fails(tree: Path) -> None:
    before = {v.rule for v in found(tree, CLEAN)}
    after = found(tree, GOTO)
    assert Violation(SOURCE, 8, "15.1") in after and "15.1" not in before
    accepted = {rule: {"core": 9, "reason": "in this test"} for rule in before}
    (wrong,) = (c for c in complaints(after, accepted) if "15.1" in c)
    assert wrong.startswith("rule 15.1 is broken 1 times in the core, 0 are recorded; the last at ")


def test_a_rule_is_broken_as_often_as_recorded_and_no_less() -> None:
    twice = [Violation(SOURCE, line, "15.5") for line in (1, 2)]
    assert complaints(twice, {"15.5": {"core": 2, "reason": "early returns"}}) == []
    (more,) = complaints(twice, {"15.5": {"core": 1, "reason": "early returns"}})
    assert f"the last at {SOURCE}:2" in more
    (fewer,) = complaints(twice, {"15.5": {"core": 3, "reason": "early returns"}})
    assert fewer.endswith("lower it in tools/gates/misra.toml")
    (silent,) = complaints(twice, {"15.5": {"core": 2, "reason": ""}})
    assert silent == "deviation 15.5 has no reason"


def test_mutants_are_the_same_each_time_and_change_one_line(tree: Path) -> None:
    text = "int f(int a)\n{\n    /* a < 0 */\n    return (a < 3) ? 1 : 0;\n}\n"
    (tree / SOURCE).write_text(text)
    made = list(mutants_of(SOURCE, tree))
    assert made == list(mutants_of(SOURCE, tree))
    assert {m.line for m in made} <= {1, 4}, "no comment is changed"
    assert any(m.after == "    return (a <= 3) ? 1 : 0;" for m in made)
    others = list(mutants_of(SOURCE, tree, "seed"))
    assert set(made) < set(others) and others != list(mutants_of(SOURCE, tree, "another"))
    assert any(m.after == "    return (a < 3) ? 0 : 1;" for m in others), "a kind of its own"
    for mutant in made:
        assert mutant.text(tree).count(mutant.before) == 0 or mutant.before in mutant.after


def test_every_survivor_needs_an_argument_and_every_argument_a_survivor() -> None:
    found = {SOURCE: {"survivors": ["part.c: a -> b"]}}
    assert unreviewed(found, {"part.c: a -> b": "the same function"}) == []
    (missing,) = unreviewed(found, {})
    assert missing == "no argument for the survivor part.c: a -> b"
    assert unreviewed({}, {"part.c: a -> b": "not drawn"}) == []
    (wrong,) = unreviewed(
        found | {SOURCE: {"survivors": [], "refuted": ["part.c: a -> b"]}}, {"part.c: a -> b": "no"}
    )
    assert wrong == "part.c: a -> b is argued about, but it is killed"
    (empty,) = unreviewed(found, {"part.c: a -> b": ""})
    assert empty == "no words in the argument for part.c: a -> b"


def test_an_argument_ends_with_its_line(tree: Path) -> None:
    (tree / SOURCE).write_text("int a; /* b */\n")
    name = Path(SOURCE).name
    reviewed = {f"{name}: int a;  -> int c; ": "", f"{name}: int b; -> int c;": ""}
    (gone,) = outdated(reviewed, [SOURCE], tree)
    assert gone == f"{name}: int b; -> int c; is argued about, but {name} has no such line"
