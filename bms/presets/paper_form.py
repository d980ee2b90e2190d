"""The gains of the paper, which its figures and the slips in its formulas are shown with."""

from __future__ import annotations

from dataclasses import replace

from bms.presets.schema import Gains, Preset

PAPER_GAINS = Gains(alpha1_per_s=0.05, alpha3_per_s2=0.05, alpha4_per_s=0.6)
"""Ahamed and Roy; the core gain is 1/(Rc Cc), the surface condition the paper's own."""
GROWTH_A_PER_S = 2.3
"""Growth of the current beside them, of which the paper says nothing: 1C per second."""


def in_paper_form(preset: Preset) -> Preset:
    """The preset with the paper's gains and surface condition in place of its own."""
    limits = replace(preset.limits, current_growth_A_per_s=GROWTH_A_PER_S)
    return replace(preset, gains=PAPER_GAINS, limits=limits)
