"""The state of function by other C sources: `python -m tests.hil_sim.function_mutant TREE OUT`

Builds the tree's sources into a folder and prints the worst excess over any limit when what they
allow two equal cells for 10 s is held for 10 s, in a charge from empty and in one of nearly full
cells; below 0 none is crossed.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from hil_sim.studies.pack.native_build import PACK
from tests.hil_sim.pack_mutant import FLAGS


def nearly_full(preset, model):
    """Two equal cells at a state of charge at which the voltage governs soon."""
    from hil_sim.pack.settings import PackChargeSettings  # noqa: PLC0415 (after a build)
    from hil_sim.pack.spread_kind import SpreadKind  # noqa: PLC0415

    start = replace(preset, initial=replace(preset.initial, soc=0.93))
    return PackChargeSettings(start, model, 2, spread=SpreadKind.NONE)


def main(tree: Path, out: Path) -> None:
    PACK.builder(FLAGS, tree).compile(tmpdir=str(out))
    PACK.load_build(out)
    from bms.model.pair import load_pair  # noqa: PLC0415 (after the build is in its place)
    from hil_sim.pack.function_study import OURS, samples  # noqa: PLC0415

    full = nearly_full(*load_pair("paper_calibrated", None))
    empty = replace(full, preset=load_pair("paper_calibrated", None)[0])
    found = [*samples(full, 10), *samples(empty, 100)]
    print(max(float(one.over[OURS].max()) for one in found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
