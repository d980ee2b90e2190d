"""Mutants of a C source by the rules of universalmutator, in an order that a hash draws."""

from __future__ import annotations

import contextlib
import hashlib
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

RULES = ["universal.rules", "c_like.rules", "c.rules"]
MORE_RULES = str(Path(__file__).parent / "more.rules")
"""What other tools change: casts, returned and assigned values, calls, neighbours' names."""
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_NOT_CODE = [r"^\s*#", r"^typedef char ", r"^\s*$", r"^[{}]"]


@dataclass(frozen=True)
class Mutant:
    """A source with one line changed."""

    source: str
    line: int
    before: str
    after: str

    @property
    def key(self) -> str:
        """By what the reviewed list knows it: it stays the same when lines move."""
        return f"{Path(self.source).name}: {self.before} -> {self.after}"

    def text(self, root: Path) -> str:
        """The whole source with the change."""
        lines = code_lines(root / self.source)
        lines[self.line - 1] = self.after
        return "\n".join(lines) + "\n"


def code_lines(path: Path) -> list[str]:
    """Lines of a source, all of them, without comments: the rules leave out a line that has one."""
    text = path.read_text(encoding="utf-8")
    return _COMMENT.sub(lambda match: "\n" * match[0].count("\n"), text).splitlines()


def mutants_of(source: str, root: Path, seed: str = "") -> Iterator[Mutant]:
    """Every mutant that the rules make, those that do not compile too; the draw is by a hash.

    A seed draws others, and of more kinds.
    """
    mutants_regexp = import_module("universalmutator.mutator").mutants_regexp
    lines = code_lines(root / source)
    with contextlib.redirect_stdout(io.StringIO()):
        rules = [*RULES, MORE_RULES] if seed else RULES
        made = mutants_regexp([f"{line}\n" for line in lines], rules, ignorePatterns=_NOT_CODE)
    found = {
        Mutant(source, number, lines[number - 1], after.rstrip("\n"))
        for number, after, *_ in made
        if after.split() != lines[number - 1].split()
    }
    return iter(sorted(found, key=lambda mutant: _draw(mutant, seed)))


def _draw(mutant: Mutant, seed: str) -> tuple[str, int]:
    drawn = hashlib.sha256(f"{seed}{mutant.source}\n{mutant.before}\n{mutant.after}".encode())
    return drawn.hexdigest(), mutant.line
