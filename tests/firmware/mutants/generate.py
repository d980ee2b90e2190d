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
        lines = _without_comments((root / self.source).read_text(encoding="utf-8"))
        lines[self.line - 1] = self.after
        return "\n".join(lines) + "\n"


def _without_comments(text: str) -> list[str]:
    """Lines as numerous as before, since the rules leave out each line that has a comment."""
    return _COMMENT.sub(lambda match: "\n" * match[0].count("\n"), text).splitlines()


def mutants_of(source: str, root: Path) -> Iterator[Mutant]:
    """Every mutant that the rules make, those that do not compile too; the draw is by a hash."""
    mutants_regexp = import_module("universalmutator.mutator").mutants_regexp
    lines = _without_comments((root / source).read_text(encoding="utf-8"))
    with contextlib.redirect_stdout(io.StringIO()):
        made = mutants_regexp([f"{line}\n" for line in lines], RULES, ignorePatterns=_NOT_CODE)
    found = {
        Mutant(source, number, lines[number - 1], after.rstrip("\n"))
        for number, after, *_ in made
        if after.split() != lines[number - 1].split()
    }
    return iter(sorted(found, key=_draw))


def _draw(mutant: Mutant) -> tuple[str, int]:
    drawn = hashlib.sha256(f"{mutant.source}\n{mutant.before}\n{mutant.after}".encode())
    return drawn.hexdigest(), mutant.line
