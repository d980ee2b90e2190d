"""A charge asked anew by other C sources: `python -m tests.hil_sim.plug_in_mutant TREE OUT RULE`

Builds the tree's sources into a folder and prints "kept" or "broken" for a rule.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hil_sim.studies.pack.native_build import PACK
from tests.hil_sim.pack_mutant import FLAGS


def main(tree: Path, out: Path, rule: str) -> None:
    PACK.builder(FLAGS, tree).compile(tmpdir=str(out))
    PACK.load_build(out)
    from tests.hil_sim.test_pack_plug_in import RULES  # noqa: PLC0415

    print("kept" if RULES[rule]() else "broken")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
