"""The requirements of docs/safety and what each is traced to, read from Doorstop's own files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

REQUIREMENTS = Path("docs/safety/requirements")


@dataclass(frozen=True)
class Reference:
    """A file of the repository, and a text that has to stand in it; the empty one always does."""

    path: str
    keyword: str

    def is_there(self, root: Path) -> bool:
        """Whether the file has the text."""
        file = root / self.path
        return file.is_file() and self.keyword in file.read_text(encoding="utf-8")


@dataclass(frozen=True)
class Requirement:
    """What an item says, the goals that it serves, and its references."""

    name: str
    header: str
    goals: tuple[str, ...]
    references: tuple[Reference, ...]

    @property
    def tests(self) -> tuple[Reference, ...]:
        """References to tests."""
        return tuple(r for r in self.references if r.path.startswith("tests/"))


def load_requirements(root: Path) -> list[Requirement]:
    """All items in the order of their names; ValueError for a file that Doorstop did not write."""
    return [_parsed(path) for path in sorted((root / REQUIREMENTS).glob("[A-Z]*.yml"))]


def _parsed(path: Path) -> Requirement:
    """Of the few forms of YAML that Doorstop writes, those of header, links and references."""
    header, part, goals = "", "", list[str]()
    references, entry = list[Reference](), dict[str, str]()
    for line in path.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith((" ", "-")):
            part = line.split(":")[0]
        elif part == "header" and not header:
            header = line.strip()
        elif part == "links" and line.startswith("- "):
            goals.append(line.removeprefix("- ").split(":")[0])
        elif part == "references":
            key, _, value = line.strip("- ").partition(": ")
            if line.startswith("- "):
                entry = {}
            # Within quotes a quote stands for itself where it stands twice.
            entry[key] = value[1:-1].replace("''", "'") if value.startswith("'") else value
            if key == "path":
                references.append(Reference(entry["path"], entry.get("keyword", "")))
    if not header or not references:
        raise ValueError(f"{path}: no header or no references")
    return Requirement(path.stem, header, tuple(goals), tuple(references))
