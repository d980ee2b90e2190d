"""Instructions of a control period by function, in mid-charge and while a plan is sought.

python -m hil_sim.studies.cost [--board mps2-an386] (after `make cost`; the compiled-in preset)
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from bms.errors import InputError
from bms.presets import load_preset
from hil_sim.run.settings import Settings
from hil_sim.studies.cost.by_function import (
    SEARCHING,
    WITHOUT_PLANNER,
    instructions_by_function,
)
from hil_sim.studies.cost.charges import charge_records

LEAST_SHARE = 0.01


def main() -> int:
    """Print the tables; exit code 2 with one line when something is missing."""
    parser = argparse.ArgumentParser(prog="python -m hil_sim.studies.cost", description=__doc__)
    parser.add_argument("--board", default="mps2-an386", help="mps2-an386 or mps2-an385")
    board: str = parser.parse_args().board
    program = Path("build/firmware") / board.replace("-", "_") / "cost.elf"
    try:
        records = charge_records(Settings(load_preset("paper_calibrated"))).records
        for title, (begin, count) in {
            "without planner": WITHOUT_PLANNER,
            "while a plan is sought": SEARCHING,
        }.items():
            found = instructions_by_function(program, board, records[: begin + count], count)
            print(f"{board}, {title}: mean instructions of a period by function")
            print(_table(found))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _table(found: dict[str, float]) -> str:
    """All that are worth a line, the rest, and the sum."""
    whole = sum(found.values())
    rows = {name: count for name, count in found.items() if count >= LEAST_SHARE * whole}
    rows["others"] = whole - sum(rows.values())
    rows["all"] = whole
    return "\n".join(f"{count:9.0f}  {name}" for name, count in rows.items()) + "\n"


if __name__ == "__main__":
    sys.exit(main())
