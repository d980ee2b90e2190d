"""Keeps what gates have found, for `bms evidence`.

python -m tools.gates.records [NAME...]     none: all whose inputs have changed
"""

from __future__ import annotations

import sys
from typing import Any

from hil_sim.evidence.kept import GATES
from tools.long_checks import ROOT, LongCheck


def gates() -> dict[str, LongCheck]:
    """The gates of records.toml by name."""
    return {gate.name: gate for gate in LongCheck.load(ROOT, GATES)}


def keep(name: str, inputs_sha256: str, said: Any) -> None:
    """Keep what a gate has found with inputs of this hash, unless they have changed meanwhile."""
    gate = gates()[name]
    if gate.inputs_sha256(ROOT) == inputs_sha256:
        gate.keep(ROOT, inputs_sha256, said)


def main(names: list[str]) -> int:
    """Run the named gates, or those that have changed; 1 when one fails."""
    known = gates()
    if unknown := set(names) - set(known):
        print(f"no gate {sorted(unknown)}; {GATES} has the names", file=sys.stderr)
        return 2
    failed = False
    for gate in known.values():
        if gate.name in names or (not names and not gate.is_current(ROOT)):
            # Those two keep what they find themselves, and say it in words.
            by_itself = gate.command[0] == "make"
            passed = gate.succeeds() if by_itself else gate.run()
            print(f"{gate.name}: {'passed' if passed else 'FAILED'}", file=sys.stderr, flush=True)
            failed = failed or not passed
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
