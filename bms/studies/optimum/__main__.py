"""The bounds of the shipped presets' own charges: `python -m bms.studies.optimum`.

Writes bms/presets/optimum.json, from which `bms sil` takes them without a solver.
"""

from __future__ import annotations

import json
from dataclasses import asdict

from bms.files import write_text
from bms.presets import load_preset, preset_names
from bms.presets.optimum import KNOWN_BOUNDS, KnownBound, KnownBounds, charge_digest
from bms.studies.optimum.answer import stated_s
from bms.studies.optimum.bound import SAMPLES, lower_bound
from bms.studies.optimum.charge import charge_of
from bms.waiting import waiting

MADE_BY = "python -m bms.studies.optimum"


def main() -> None:
    """Compute the bounds anew, some minutes, and write the file."""
    names = preset_names()
    bounds = {}
    with waiting("bounds", len(names), "presets") as wait:
        for name in names:
            wait.begin(name)
            preset = load_preset(name)
            charge = charge_of(preset)
            bounds[name] = KnownBound(
                charge=charge_digest(preset),
                optimum_time_s=stated_s(lower_bound(charge.physics_alone())),
                lower_bound_s=stated_s(lower_bound(charge)),
            )
    content = asdict(KnownBounds(MADE_BY, SAMPLES, bounds))
    write_text(KNOWN_BOUNDS, json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
