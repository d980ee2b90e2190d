"""What the Markdown of the repository names: links, paths, commands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`([^`\n]+(?:\n[^`\n]+)?)`")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def name(page: Path) -> str:
    """Path in the repository."""
    return page.relative_to(ROOT).as_posix()


def links(page: Path) -> list[str]:
    """Targets of links and images to other files, without their anchors."""
    text = _FENCE.sub("", page.read_text(encoding="utf-8"))
    targets = (found[1].partition("#")[0] for found in _LINK.finditer(text))
    return [target for target in targets if target and ":" not in target]


def paths(page: Path) -> list[str]:
    """Paths of the repository in running text, as code; `*` is a pattern, NAME a placeholder."""
    text = _FENCE.sub("", page.read_text(encoding="utf-8"))
    folders = [path.name for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "."]
    tracked = "|".join(sorted(set(folders) - {"build", "out"}))
    form = re.compile(rf"(?:{tracked})/[\w./*-]*")
    named = (code for code in _INLINE.findall(text) if form.fullmatch(code))
    return [path for path in named if "NAME" not in path.split("/")]


def commands(page: Path) -> Iterator[list[str]]:
    """Words of each shell command with make, bms or python, from code in blocks and in the text."""
    text = page.read_text(encoding="utf-8")
    blocks = [found[0].partition("\n")[2] for found in _FENCE.finditer(text)]
    rest = _FENCE.sub("", text)
    indented = [line for line in rest.splitlines() if line.startswith("    ")]
    inline = [" ".join(found[1].split()) for found in _INLINE.finditer(rest)]
    for line in "\n".join([*blocks, *indented, *inline]).splitlines():
        for part in re.split(r"&&|[;&|]| # |\$\(", line.strip().removeprefix("$ ")):
            yield from _command(part)


def _command(text: str) -> Iterator[list[str]]:
    try:
        words = shlex.split(text, comments=True)
    except ValueError:  # half of a quoted text: what is quoted stands alone elsewhere
        words = text.split()
    for place, word in enumerate(words):
        if word.rpartition("/")[2] in {"make", "bms", "python"}:
            yield [word.rpartition("/")[2], *words[place + 1 :]]
            return
