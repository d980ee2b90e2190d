"""The report for assessors: what is recorded, each record held to the present sources."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import zipfile
from pathlib import Path

import pytest

from bms.errors import InputError
from bms.native_build import ROOT
from hil_sim.evidence.collect import (
    CURRENT,
    INCOMPLETE,
    MISSING,
    MUTANTS,
    PLAN,
    STALE,
    Item,
    collect,
)
from hil_sim.evidence.kept import GATES, LONG_CHECKS, KeptCheck, mutants_hash
from hil_sim.evidence.page import archive, numbers, page
from hil_sim.evidence.trace import load_requirements
from tests.hil_sim.command_line import bms

pytestmark = pytest.mark.slow

LEFT_OUT = (".git", ".venv", "build", "out", "node_modules", "__pycache__", "*.so", "*.egg-info")
SAID = {
    "coverage": {
        "a.c": {"ways": 4, "ways_reached": 4, "conditions": 3, "conditions_reached": 2},
    },
    "misra": {"core: 15.5": 61},
    "budgets": {"m3": {"image": {"flash": 7, "ram": 8}, "core": {"stack": 9}}},
    "instructions": [{"target": "m3"}],
    "certificates": {"lin2014": {"certified": True}},
}
LISTED = [
    (file, check.name) for file in (GATES, LONG_CHECKS) for check in KeptCheck.load(ROOT, file)
]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with every record, all made of the files that lie in it."""
    root = tmp_path_factory.mktemp("checkout") / "tree"
    shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
    for listed in (GATES, LONG_CHECKS):
        for check in KeptCheck.load(root, listed):
            said = SAID[check.name] if listed == GATES else (check.result(root) or {})["said"]
            check.keep(root, check.inputs_sha256(root), said)
    sources = collect_sources(root)
    entries = {
        source: {"sha256": mutants_hash(root, source), "tried": 3, "killed": 3, "survivors": []}
        for source in sources
    }
    (root / MUTANTS).write_text(json.dumps(entries))
    return root


def collect_sources(root: Path) -> list[str]:
    lines = (root / PLAN).read_text().splitlines()
    return [line.split('"')[1] for line in lines if line.startswith('"firmware_c/')]


def item(root: Path, name: str) -> Item:
    (found,) = [i for s in collect(root).sections for i in s.items if i.name == name]
    return found


class Changed:
    """A file of a tree with other content, until the end of a block."""

    def __init__(self, path: Path, content: bytes | None) -> None:
        self._path, self._content = path, content
        self._before = path.read_bytes()

    def __enter__(self) -> None:
        if self._content is None:
            self._path.unlink()
        else:
            self._path.write_bytes(self._content)

    def __exit__(self, *_: object) -> None:
        self._path.write_bytes(self._before)


def test_a_checkout_whose_records_are_of_its_own_files_is_complete(tree: Path) -> None:
    evidence = collect(tree)
    assert evidence.open_items() == []
    assert [s.title for s in evidence.sections] == [
        *("Requirements", "Coverage", "Mutants", "Proofs", "MISRA C:2012", "Fault matrix"),
        *("Budgets", "Certificates", "Campaigns and long checks"),
    ]


@pytest.mark.parametrize(("listed", "name"), LISTED, ids=[name for _, name in LISTED])
def test_a_record_is_stale_once_an_input_has_changed_and_missing_without_it(
    tree: Path, listed: Path, name: str
) -> None:
    (check,) = [c for c in KeptCheck.load(tree, listed) if c.name == name]
    first = min(path for path in tree.glob(check.inputs[0]) if path.is_file())
    assert item(tree, name).state == CURRENT
    with Changed(first, first.read_bytes() + b"\n"):
        assert item(tree, name).state == STALE
        assert item(tree, name).remedy
    with Changed(tree / check.path, None):
        assert item(tree, name).state == MISSING
        assert item(tree, name).remedy
    assert item(tree, name).state == CURRENT


def test_what_a_record_says_is_what_is_reported(tree: Path) -> None:
    for listed, name in LISTED:
        (check,) = [c for c in KeptCheck.load(tree, listed) if c.name == name]
        said = (check.result(tree) or {})["said"]
        shown = item(tree, name).numbers
        assert said == (shown["said"] if name == "three-places" else shown)
    assert "2 of 3 conditions" in item(tree, "coverage").says
    claims = json.loads((tree / "results/proofs.json").read_text())["said"]["properties"].values()
    assert f"{sum(claims)} claims" in item(tree, "proofs").says
    assert "10000 charges: core 0" in item(tree, "family-a123_26650").says


def test_survivors_need_an_argument_and_mutants_are_of_their_source(tree: Path) -> None:
    source = "firmware_c/src/soc.c"
    entries = json.loads((tree / MUTANTS).read_text())
    entries[source]["survivors"] = ["soc.c: a -> b"]
    with Changed(tree / MUTANTS, json.dumps(entries).encode()):
        assert item(tree, source).state == INCOMPLETE
    with Changed(tree / source, (tree / source).read_bytes() + b"\n"):
        assert item(tree, source).state == STALE
        assert item(tree, "firmware_c/src/pace.c").state == CURRENT
    del entries[source]
    with Changed(tree / MUTANTS, json.dumps(entries).encode()):
        assert item(tree, source).state == MISSING


def test_a_reference_that_leads_nowhere_makes_a_requirement_incomplete(tree: Path) -> None:
    requirement = load_requirements(tree)[0]
    test = requirement.tests[0]
    assert item(tree, requirement.name).state == CURRENT
    text = (tree / test.path).read_text().replace(test.keyword, "def renamed(")
    with Changed(tree / test.path, text.encode()):
        found = item(tree, requirement.name)
    assert found.state == INCOMPLETE
    assert found.numbers["gone"] == [f"{test.path}: {test.keyword}"]


def test_the_requirements_are_those_that_doorstop_reads(tree: Path) -> None:
    doorstop = pytest.importorskip("doorstop")
    read = {str(i.uid): i for d in doorstop.build(root=str(ROOT)) for i in d if d.prefix == "REQ"}
    ours = {r.name: r for r in load_requirements(ROOT)}
    assert set(ours) == set(read)
    for name, requirement in ours.items():
        assert requirement.header == read[name].header.strip()
        assert set(requirement.goals) == {str(uid) for uid in read[name].links}
        assert [(r.path, r.keyword) for r in requirement.references] == [
            (r["path"], r.get("keyword", "")) for r in read[name].references
        ]


def test_the_same_records_give_the_same_bytes(tree: Path) -> None:
    one, other = collect(tree), collect(tree)
    assert page(one, None) == page(other, None)
    assert numbers(one, None) == numbers(other, None)
    assert archive(one) == archive(other)
    dated = json.loads(numbers(one, "2026-01-02"))
    assert dated.pop("date") == "2026-01-02"
    without = json.loads(numbers(one, None))
    assert without.pop("date") is None
    assert dated == without
    assert "2026-01-02" in page(one, "2026-01-02") and "2026-01-02" not in page(one, None)


def test_the_archive_has_the_records_whose_hashes_are_reported(tree: Path) -> None:
    evidence = collect(tree)
    told = {
        path: digest
        for section in json.loads(numbers(evidence, None))["sections"]
        for entry in section["items"]
        for path, digest in entry["records"].items()
    }
    with zipfile.ZipFile(io.BytesIO(archive(evidence))) as file:
        assert {p: hashlib.sha256(file.read(p)).hexdigest() for p in file.namelist()} == told
    assert told.keys() >= {"results/proofs.json", "build/gates/coverage.json", "build/mutants.json"}


def test_the_page_names_every_piece_and_what_is_wanting(tree: Path) -> None:
    with Changed(tree / "build/gates/misra.json", None):
        evidence = collect(tree)
        text = page(evidence, None)
    assert "1 of" in text and "make misra" in text
    for section in evidence.sections:
        for piece in section.items:
            assert piece.name in text
    assert "All " in page(collect(tree), None)


def test_without_a_checkout_one_line_says_where_to_run_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="checkout") as refused:
        collect(tmp_path)
    assert "\n" not in str(refused.value)


DAMAGED = [
    ("results/proofs.json", b""),
    ("results/proofs.json", b"{}"),
    ("results/proofs.json", b"[1]"),
    ("results/proofs.json", b'{"said": 3, "inputs_sha256": ""}'),
    (MUTANTS.as_posix(), b""),
    (MUTANTS.as_posix(), b"[1]"),
    (MUTANTS.as_posix(), b'{"firmware_c/src/soc.c": 3}'),
]


@pytest.mark.parametrize(("path", "content"), DAMAGED)
def test_a_damaged_record_is_refused_in_one_line(tree: Path, path: str, content: bytes) -> None:
    with Changed(tree / path, content), pytest.raises(InputError) as refused:
        collect(tree)
    assert "\n" not in str(refused.value)


def test_the_command_writes_all_three_and_its_exit_code_says_whether_all_is_there(
    tmp_path: Path,
) -> None:
    wanting = collect(ROOT).open_items()
    done = bms("evidence", "--out", tmp_path / "out")
    assert done.returncode == int(bool(wanting)), done.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "evidence.html", "evidence.json", "records.zip",
    }  # fmt: skip
    for section, piece in wanting:
        assert f"{piece.state}: {section}, {piece.name}; {piece.remedy}" in done.stdout
