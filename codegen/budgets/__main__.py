"""`python -m codegen.budgets`: flash, RAM and stack of a built image against limits."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from bms.errors import BmsError
from codegen.budgets.budgets import exceeded, load_budget, load_figures, save_figures, table
from codegen.budgets.measure import measure


def main() -> int:
    """Print the table; exit code 1 when a limit is exceeded, 2 when the stack cannot be bounded."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("build", type=Path, help="folder that the rules of a port have filled")
    parser.add_argument("--target", required=True, help="name of the port, as in budgets.toml")
    parser.add_argument("--firmware", type=Path, default=Path("firmware_c"), help="folder of both")
    parser.add_argument("--cross", default="arm-none-eabi-", help="prefix of the binutils")
    parser.add_argument(
        "--accept", action="store_true", help="make these the figures to compare with"
    )
    arguments = parser.parse_args()
    figures_file = arguments.firmware / "figures.json"
    try:
        budget = load_budget(arguments.firmware / "budgets.toml", arguments.target)
        figures = measure(arguments.build, budget, arguments.cross)
    except BmsError as error:
        print(f"budgets: {error}", file=sys.stderr)
        return 2
    print(f"{arguments.target}: change since the figures in {figures_file}")
    print(table(figures, load_figures(figures_file, arguments.target)))
    if arguments.accept:
        save_figures(figures_file, arguments.target, figures)
    lines = exceeded(figures, budget.limits)
    for line in lines:
        print(f"budgets: {arguments.target} {line}", file=sys.stderr)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
