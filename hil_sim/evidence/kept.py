"""Checks whose last result is kept with a hash of the files on which it rests."""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from bms.native_build import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LONG_CHECKS = Path("results/checks.toml")
"""Checks that take too long for every run of the tests; their results are committed."""
GATES = Path("tools/gates/records.toml")
"""Checks whose results are kept below build, where they were run."""


Kept = TypeVar("Kept", bound="KeptCheck")


@dataclass(frozen=True)
class KeptCheck:
    """A command, the files (patterns in the repository) on which its answer rests, its list."""

    name: str
    command: tuple[str, ...]
    inputs: tuple[str, ...]
    listed: Path = LONG_CHECKS

    @classmethod
    def load(cls: type[Kept], root: Path, listed: Path) -> list[Kept]:
        """The checks of a list in their order."""
        content = tomllib.loads((root / listed).read_text(encoding="utf-8"))
        return [
            cls(name, tuple(check["command"]), tuple(check["inputs"]), listed)
            for name, check in content.items()
        ]

    @property
    def path(self) -> Path:
        """Of the kept result, in the repository."""
        folder = Path("build/gates") if self.listed == GATES else self.listed.parent
        return folder / f"{self.name}.json"

    def inputs_sha256(self, root: Path = ROOT) -> str:
        """Hash of names and content of all inputs; ValueError when a pattern finds none."""
        paths: set[Path] = set()
        for pattern in self.inputs:
            found = {path for path in root.glob(pattern) if path.is_file()}
            if not found:
                raise ValueError(f"{self.listed}: {self.name}: no file for '{pattern}'")
            paths |= found
        digest = hashlib.sha256("\0".join(self.command).encode())
        for path in sorted(paths):
            digest.update(f"\n{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
        return digest.hexdigest()

    def result(self, root: Path = ROOT) -> dict[str, Any] | None:
        """The kept result; None without one."""
        path = root / self.path
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None

    def is_current(self, root: Path = ROOT) -> bool:
        """Whether the kept result rests on the files that lie here now."""
        result = self.result(root)
        return result is not None and result["inputs_sha256"] == self.inputs_sha256(root)

    def keep(self, root: Path, inputs_sha256: str, said: Any) -> None:
        """Keep what the command said of inputs with this hash."""
        content = {"command": " ".join(self.command), "inputs_sha256": inputs_sha256, "said": said}
        path = root / self.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def mutants_hash(root: Path, source: str) -> str:
    """Hash of a source and of the core's headers, for a pack's source its own too, on which its
    mutants rest.
    """
    digest = hashlib.sha256()
    folders = ["include", "src", "image", "boot", "port", "port/linux"]
    if source.startswith("firmware_c/pack"):
        folders += ["pack", "pack/generated", "pack_ecu"]
    headers = [h for f in folders for h in sorted((root / "firmware_c" / f).glob("*.h"))]
    for path in (root / source, *headers):
        digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()
