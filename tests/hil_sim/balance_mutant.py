"""Balancing by other C sources: `python -m tests.hil_sim.balance_mutant TREE OUT`

Builds the tree's sources into a folder and prints which rules a pack that is balanced breaks:
"missing" where a cell is bled in a period without the coolant's message, "emptiest" where the
emptiest cell is.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hil_sim.studies.pack.native_build import PACK
from tests.hil_sim.pack_mutant import FLAGS


def main(tree: Path, out: Path) -> None:
    PACK.builder(FLAGS, tree).compile(tmpdir=str(out))
    PACK.load_build(out)
    from tests.hil_sim.test_pack_balance import CELLS, Rig, without  # noqa: PLC0415

    rig = Rig()
    counted = [rig.ecu.state.pack.cell[i].soc.soc for i in range(CELLS)]
    if rig.bleeds[counted.index(min(counted))]:
        print("emptiest")
    rig.run(1, sent=without(0x201))
    if any(rig.bleeds):
        print("missing")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
