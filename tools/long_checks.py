"""Checks that take too long for every test run: runs them and keeps what they said.

    python tools/long_checks.py [NAME...]     none: all whose inputs have changed

A result is only as good as its inputs: results/NAME.json has their hash, and the tests fail when it
is no longer that of the files here. See results/checks.toml.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from hil_sim.evidence.kept import LONG_CHECKS, KeptCheck

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path("results")


class LongCheck(KeptCheck):
    """A check that can be run."""

    def succeeds(self, root: Path = ROOT) -> bool:
        """Run the command for its exit code alone."""
        return (
            subprocess.run(self.command, cwd=root, stdout=sys.stderr, check=False).returncode == 0
        )

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
        self.keep(root, before, said)
        return True


def load_checks(root: Path = ROOT) -> list[LongCheck]:
    """The checks of results/checks.toml in their order."""
    return LongCheck.load(root, LONG_CHECKS)


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
