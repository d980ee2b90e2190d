"""Prints the table: `python -m hil_sim.studies.family_plants [--json] PRESET...`."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict

from bms.errors import BmsError
from bms.presets import load_preset
from hil_sim.studies.family_plants.charges import ChargeOfPlant, charges_of_plants

DEFAULT_PRESETS = ("a123_26650_10C", "a123_26650")


def main() -> int:
    """Charge, print, and return 1 when a limit was crossed or a charge was not completed."""
    names = [argument for argument in sys.argv[1:] if argument != "--json"] or DEFAULT_PRESETS
    charges = [charge for name in names for charge in charges_of_plants(load_preset(name))]
    if "--json" in sys.argv:
        print(json.dumps({"charges": [asdict(c) | {"is_safe": c.is_safe} for c in charges]}))
    else:
        _print(charges)
    return 0 if all(charge.is_safe for charge in charges) else 1


def _print(charges: list[ChargeOfPlant]) -> None:
    print("| preset | plant | from | time s | soc | core K | surface K | voltage mV | anode mV |")
    print("|---|---|---|---|---|---|---|---|---|")
    for c in charges:
        anode = "" if c.min_anode_potential_V is None else f"{1e3 * c.min_anode_potential_V:+.0f}"
        time = c.stop_reason if c.charge_time_s is None else f"{c.charge_time_s:.0f}"
        print(
            f"| {c.preset} | {c.plant} | {c.start_K:g} K | {time} | {c.final_soc:.3f} "
            f"| {c.core_over_K:+.2f} | {c.surface_over_K:+.2f} | {1e3 * c.voltage_over_V:+.1f} "
            f"| {anode} |"
        )


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BmsError as error:
        sys.exit(f"family_plants: {error}")
