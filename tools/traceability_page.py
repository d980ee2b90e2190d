"""Writes docs/safety/traceability.md: safety goals, requirements, code, tests, kept results.

    python -m tools.traceability_page

The items are Doorstop's, one file each in docs/safety; `doorstop --error-all` holds links, files
and words in them, tests/docs/test_safety_case.py what that leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import doorstop

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "safety" / "traceability.md"
MATRIX = "hil_sim/fault_matrix/matrix.toml"
KEPT = "results/checks.toml"
_HEAD = """# From goals to tests

Made by `python -m tools.traceability_page` from the items in `docs/safety/goals` and
`docs/safety/requirements`, which are [Doorstop](https://doorstop.readthedocs.io)'s. The tests
fail when a requirement has no goal, no code or no test, when a file or a name in it is gone, when a
text has changed without a review, and when a test of the firmware or a row of the fault matrix
belongs to no requirement."""


@dataclass(frozen=True)
class Requirement:
    """One requirement: ids of its goals, and where it is met and shown."""

    uid: str
    title: str
    text: str
    goals: tuple[str, ...]
    code: tuple[str, ...]
    """Files; of C and of Python."""
    tests: tuple[tuple[str, str], ...]
    """File, and name of the test; the name is empty where the whole file is meant."""
    rows: tuple[str, ...]
    """Names in the fault matrix."""
    kept: tuple[str, ...]
    """Names of long checks."""


@dataclass(frozen=True)
class Goal:
    """One safety goal."""

    uid: str
    title: str
    text: str


def load_items(root: Path = ROOT) -> tuple[tuple[Goal, ...], tuple[Requirement, ...]]:
    """Goals and requirements in the order of their ids."""
    tree = doorstop.build(cwd=str(root), root=str(root))
    goals = (Goal(*_heading(item)) for item in tree.find_document("SG").items)
    requirements = (_requirement(item) for item in tree.find_document("REQ").items)
    return (
        tuple(sorted(goals, key=lambda goal: goal.uid)),
        tuple(sorted(requirements, key=lambda requirement: requirement.uid)),
    )


def traceability_page(root: Path = ROOT) -> str:
    """Markdown of the page."""
    goals, requirements = load_items(root)
    lines = [_HEAD]
    for goal in goals:
        met_by = ", ".join(
            f"[{one.uid}](#{one.uid.lower()})" for one in requirements if goal.uid in one.goals
        )
        lines += [f"## {goal.uid}", f"**{goal.title}.** {goal.text}", met_by]
    for one in requirements:
        lines += [f"## {one.uid}", f"**{one.title}.** {one.text}", _table(one)]
    return "\n\n".join(lines) + "\n"


def _heading(item: doorstop.Item) -> tuple[str, str, str]:
    return str(item.uid), str(item.header).strip(), str(item.text).strip()


def _requirement(item: doorstop.Item) -> Requirement:
    places = [(entry["path"], entry.get("keyword", "")) for entry in item.references or ()]
    named = {path: tuple(word for at, word in places if at == path) for path in (MATRIX, KEPT)}
    others = [place for place in places if place[0] not in named]
    return Requirement(
        *_heading(item),
        goals=tuple(str(link) for link in item.links),
        code=tuple(dict.fromkeys(path for path, _ in others if not path.startswith("tests/"))),
        tests=tuple(
            (path, word.removeprefix("def ").removesuffix("("))
            for path, word in others
            if path.startswith("tests/")
        ),
        rows=tuple(word.removeprefix('name = "').removesuffix('"') for word in named[MATRIX]),
        kept=named[KEPT],
    )


def _table(one: Requirement) -> str:
    tests = [f"`{path}` {name.replace('_', ' ')}".strip() for path, name in one.tests]
    cells = {
        "goals": ", ".join(f"[{goal}](#{goal.lower()})" for goal in one.goals),
        "code": ", ".join(f"`{path}`" for path in one.code),
        "tests": "<br>".join(tests),
        "rows of the fault matrix": ", ".join(one.rows),
        "kept results": ", ".join(one.kept),
    }
    rows = [f"| {name} | {cell} |" for name, cell in cells.items() if cell]
    return "\n".join(["| | |", "|---|---|", *rows])


if __name__ == "__main__":
    PAGE.write_text(traceability_page(), encoding="utf-8")
