"""Prints what each way to know the core is worth: `python -m hil_sim.studies.estimate_value`.

The same cells of a preset's family are charged by firmware that (a) takes the core as in its steady
state, (b) relies on its observer of the hottest core, (c) trusts a network as far as its bound for
the nominal cell, which nobody can vouch for over a family, and (d) trusts it as far as it was off.
"""

from __future__ import annotations

import csv
import io
import statistics
import sys
from dataclasses import replace

from bms.errors import BmsError
from bms.model.model_file import load_shipped_model
from bms.presets import Preset, load_preset
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings
from hil_sim.studies.campaign.rows import header
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily, default_max_time_s
from hil_sim.studies.campaign.worker import run_chunk

RUNS = 400
STARTS = ((0.1, 298.15), (0.1, 313.0), (0.5, 313.0))
"""State of charge and temperature (K) of the nominal cell's charges."""


def variants(preset: Preset, nominal_error_K: float) -> dict[str, Preset]:
    """The preset by how the core is known."""
    gains = preset.gains

    def with_gains(alpha2_per_s: float | None, error_K: float | None) -> Preset:
        changed = replace(gains, alpha2_per_s=alpha2_per_s, estimate_error_K=error_K)
        return replace(preset, gains=changed)

    return {
        "steady state, no estimate": with_gains(None, None),
        "observer": with_gains(gains.alpha2_per_s, None),
        f"observer or network, {nominal_error_K:.2f} K": with_gains(
            gains.alpha2_per_s, nominal_error_K
        ),
        "observer or network, 5 K": with_gains(gains.alpha2_per_s, 5.0),
    }


def main() -> int:
    """One Markdown table for each preset named."""
    for name in sys.argv[1:] or ["a123_26650_10C"]:
        preset, model = load_preset(name), load_shipped_model(name)
        heads = " | ".join(f"{soc:g}, {temperature_K:g} K" for soc, temperature_K in STARTS)
        print(f"\n| {name} | {heads} | median of {RUNS} | core over | worst K |")
        print("|---|" + "---|" * (len(STARTS) + 3))
        for label, variant in variants(preset, model.error_bound_K).items():
            times = []
            for soc, temperature_K in STARTS:
                start = replace(variant.initial, soc=soc, temperature_K=temperature_K)
                result = run_sil(Settings(variant, model=model, initial=start))
                times.append(result.summary.charge_time_s or float("nan"))
            settings = CampaignSettings(
                variant,
                model,
                RUNS,
                max_time_s=default_max_time_s(variant, CellFamily.REAL),
                family=CellFamily.REAL,
            )
            text = header(settings.family) + "".join(
                run_chunk(settings, c) for c in settings.chunks()
            )
            rows = list(csv.DictReader(io.StringIO(text)))
            limit_K = variant.limits.max_core_temperature_K
            peaks = [float(row["kan_rcbf_max_core_temperature_K"]) - limit_K for row in rows]
            done = [
                float(row["kan_rcbf_charge_time_s"])
                for row in rows
                if row["kan_rcbf_charge_time_s"]
            ]
            print(
                f"| {label} | "
                + " | ".join(f"{time_s:.0f} s" for time_s in times)
                + f" | {statistics.median(done):.0f} s | {sum(p > 0.0 for p in peaks)} "
                f"| {max(peaks):+.2f} |"
            )
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BmsError as error:
        sys.exit(f"estimate_value: {error}")
