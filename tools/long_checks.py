"""Checks that take too long for every test run: runs them and keeps what they said.

    python tools/long_checks.py [NAME...]     none: all whose inputs have changed

A result is only as good as its inputs: results/NAME.json has their hash, and the tests fail when it
is no longer that of the files here. See results/checks.toml.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path("results")


@dataclass(frozen=True)
class LongCheck:
    """A command, and the files (patterns in the repository) on which its answer rests."""

    name: str
    command: tuple[str, ...]
    inputs: tuple[str, ...]

    def inputs_sha256(self, root: Path = ROOT) -> str:
        """Hash of names and content of all inputs; ValueError when a pattern finds none."""
        paths: set[Path] = set()
        for pattern in self.inputs:
            found = {path for path in root.glob(pattern) if path.is_file()}
            if not found:
                raise ValueError(f"{FOLDER}/checks.toml: {self.name}: no file for '{pattern}'")
            paths |= found
        digest = hashlib.sha256("\0".join(self.command).encode())
        for path in sorted(paths):
            digest.update(f"\n{path.relative_to(root).as_posix()}\n".encode() + path.read_bytes())
        return digest.hexdigest()

    def result(self, root: Path = ROOT) -> dict[str, Any] | None:
        """The kept result; None without one."""
        path = root / FOLDER / f"{self.name}.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None

    def is_current(self, root: Path = ROOT) -> bool:
        """Whether the kept result rests on the files that lie here now."""
        result = self.result(root)
        return result is not None and result["inputs_sha256"] == self.inputs_sha256(root)

    def run(self, root: Path = ROOT) -> bool:
        """Run the command and keep what it says on stdout; False when it fails."""
        before = self.inputs_sha256(root)
        if "--out" in self.command:
            # What an earlier run left there is of other inputs.
            shutil.rmtree(root / self.command[self.command.index("--out") + 1], ignore_errors=True)
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            self.command,
            cwd=root,
            env={**os.environ, "PATH": path},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        if done.returncode != 0 or self.inputs_sha256(root) != before:
            print(done.stdout)
            return False
        try:
            said = json.loads(done.stdout)
        except json.JSONDecodeError:
            # How long tests took is no result.
            said = [
                re.sub(r" in [\d.]+s( \([\d:]+\))?", "", line) for line in done.stdout.splitlines()
            ]
        content = {"command": " ".join(self.command), "inputs_sha256": before, "said": said}
        text = json.dumps(content, indent=1) + "\n"
        (root / FOLDER / f"{self.name}.json").write_text(text, encoding="utf-8")
        return True


def load_checks(root: Path = ROOT) -> list[LongCheck]:
    """The checks of results/checks.toml in their order."""
    content = tomllib.loads((root / FOLDER / "checks.toml").read_text(encoding="utf-8"))
    return [
        LongCheck(name, tuple(check["command"]), tuple(check["inputs"]))
        for name, check in content.items()
    ]


def main(names: list[str]) -> int:
    """Run the named checks, or those whose inputs have changed; 1 when one fails."""
    checks = load_checks()
    unknown = set(names) - {check.name for check in checks}
    if unknown:
        print(f"no check {sorted(unknown)}; {FOLDER}/checks.toml has the names", file=sys.stderr)
        return 2
    failed = False
    for check in checks:
        if check.name in names or (not names and not check.is_current()):
            print(f"{check.name}: {' '.join(check.command)}", file=sys.stderr, flush=True)
            passed = check.run()
            print(f"{check.name}: {'passed' if passed else 'FAILED'}", file=sys.stderr, flush=True)
            failed = failed or not passed
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
