"""Prints the table: `python -m hil_sim.studies.family_outside [PRESET]`."""

from __future__ import annotations

import sys

from bms.errors import BmsError
from bms.presets import load_preset
from hil_sim.studies.family_outside.charges import OUTSIDE, charge_outside

DEFAULT_PRESET = "a123_26650_10C"
TEMPERATURES_K = (298.15, 313.0)


def main() -> int:
    """Charge and print; nobody promises anything of such a cell, so that nothing is a failure."""
    preset = load_preset(sys.argv[1] if len(sys.argv) > 1 else DEFAULT_PRESET)
    print("| outside | from | core | surface | voltage | charged beyond | end |")
    print("|---|---|---|---|---|---|---|")
    for case in OUTSIDE:
        for temperature_K in TEMPERATURES_K:
            one = charge_outside(preset, case, temperature_K)
            end = one.end if one.first_fault is None else f"{one.end}, fault {one.first_fault}"
            print(
                f"| {one.case} | {one.start_K:g} K | {one.core_over_K:+.2f} K "
                f"| {one.surface_over_K:+.2f} K | {1e3 * one.voltage_over_V:+.1f} mV "
                f"| {one.charged_beyond_s:.1f} s | {end} |",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BmsError as error:
        sys.exit(f"family_outside: {error}")
