"""Prints what a family costs: `python -m hil_sim.studies.family_cost PRESET...`."""

from __future__ import annotations

import sys

from bms.errors import BmsError
from bms.presets import load_preset
from hil_sim.studies.family_cost.costs import family_costs, shares

TEMPERATURES_K = (298.15, 313.0)


def main() -> int:
    """One Markdown table for each preset named."""
    for name in sys.argv[1:] or ["a123_26650_10C", "a123_26650"]:
        preset = load_preset(name)
        courses = [list(family_costs(preset, temperature_K)) for temperature_K in TEMPERATURES_K]
        heads = " | ".join(f"from {temperature_K:g} K" for temperature_K in TEMPERATURES_K)
        print(f"\n| {name}: known exactly | {heads} |\n|---|---|---|")
        whole = " | ".join(f"{course[0].full_s:.1f} s" for course in courses)
        print(f"| nothing: the whole family | {whole} |")
        parts = [shares(course) for course in courses]
        for part in parts[0]:
            print(f"| {part} | " + " | ".join(f"{-share[part]:+.1f} s" for share in parts) + " |")
        exact = " | ".join(
            f"{course[-1].full_s:.1f} s (family {course[0].full_s / course[-1].full_s - 1:+.1%}, "
            f"complete {course[0].complete_s / course[-1].complete_s - 1:+.1%})"
            for course in courses
        )
        print(f"| everything | {exact} |")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BmsError as error:
        sys.exit(f"family_cost: {error}")
