"""A pack whose C sources are others: `python -m tests.hil_sim.pack_mutant TREE OUT FAULT...`

Builds the tree's sources into a folder, meets each fault with them, and prints what is wrong with
how they did, a line each; "kept" where nothing is.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hil_sim.studies.pack.native_build import PACK

FLAGS = ("-std=c99", "-O0", "-ffp-contract=off")


def main(tree: Path, out: Path, names: list[str]) -> None:
    PACK.builder(FLAGS, tree).compile(tmpdir=str(out))
    PACK.load_build(out)
    from bms.model.pair import load_pair  # noqa: PLC0415 (after the build is in its place)
    from hil_sim.pack.faults import FAULTS, complaint, run_fault  # noqa: PLC0415
    from hil_sim.pack.settings import PackChargeSettings  # noqa: PLC0415

    settings = PackChargeSettings(*load_pair("paper_calibrated", None), cells=6)
    rows = {fault.name: fault for fault in FAULTS}
    for name in names:
        result = run_fault(settings, rows[name], rows[name].stop_periods + 10)
        print(complaint(result, rows[name]) or "kept")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
