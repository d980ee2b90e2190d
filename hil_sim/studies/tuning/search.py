"""Search for the gains: one after the other up and down a ladder, as long as charges get shorter.

What counts is the geometric mean of the times to full, which is that of the times over any bound.
A set that crosses a limit, leaves a cell unfilled or is not certified does not count.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from bms.calibration.plausibility import plausibility_fields
from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.verification.verify import verify
from hil_sim.studies.tuning.charges import Outcome, outcomes, tuning_starts

STEPS = (2.0, 1.3, 1.1)
"""Factors of the ladder, one pass after the other."""
LEAST_GAIN = 2e-4
"""Share of the time that a step has to save; less is left alone."""
_DIGITS = 3
_SAMPLES = 20_000
"""States that each search for a counter-example draws within a search for gains."""


@dataclass(frozen=True)
class Choice:
    """Gains by what they do, each a positive number without a natural upper end.

    `core` is alpha2 over A1, `surface` alpha4 over the rate at which the estimate drops out of the
    surface constraint (A4 = 0), `share` the smaller of the two rates of the surface's chain over
    their sum.
    """

    alpha1_per_s: float
    core: float
    surface: float
    share: float
    growth_A_per_s: float


@dataclass(frozen=True)
class Tuned:
    """A preset with the charges that it makes, and their geometric mean in s."""

    preset: Preset
    outcomes: tuple[Outcome, ...]

    @property
    def mean_s(self) -> float:
        """Geometric mean of the times to full in s; infinite where a charge is no good."""
        if not all(outcome.is_good for outcome in self.outcomes):
            return math.inf
        logs = [math.log(outcome.time_s) for outcome in self.outcomes]
        return math.exp(math.fsum(logs) / len(logs))


def most_growth_A_per_s(preset: Preset) -> float:
    """Fastest growth with which a current that lags two periods behind is no fault yet."""
    deviation_A: float = plausibility_fields(preset)["current_deviation_A"]
    return 0.5 * deviation_A / preset.timing.sampling_period_s


def with_choice(preset: Preset, choice: Choice) -> Preset:
    """The preset with these gains, in its surface's worst-case form, to three digits."""
    cell = preset.cell
    a1_per_s = 1.0 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)
    sum_per_s = _rounded(choice.surface * _neutral_per_s(preset))
    first_per_s = sum_per_s * (1.0 - choice.share)
    gains = replace(
        preset.gains,
        alpha1_per_s=_rounded(choice.alpha1_per_s),
        # At A1 itself the estimate drops out, to the last digit.
        alpha2_per_s=None if choice.core == 1.0 else _rounded(choice.core * a1_per_s),
        alpha3_per_s2=_rounded(first_per_s * (sum_per_s - first_per_s)),
        alpha4_per_s=sum_per_s,
        surface_condition="worst-case",
    )
    growth_A_per_s = _rounded(choice.growth_A_per_s)
    limits = replace(preset.limits, current_growth_A_per_s=growth_A_per_s)
    return replace(preset, gains=gains, limits=limits)


def tune(
    preset: Preset,
    model: KanModel,
    told: Callable[[str], None] = lambda doing: None,
) -> Tuned:
    """The preset with gains that fill its nominal cell fastest; the same ones each time.

    `told` hears of each set that is tried. Raises InputError for a family, and where not even the
    set that the search begins with is certified.
    """
    if preset.cell.interval is not None:
        raise InputError(
            f"preset '{preset.name}': the gains of a family follow from its intervals; "
            "tune a preset of one cell"
        )
    starts = tuning_starts(preset)

    def tried(choice: Choice) -> Tuned:
        candidate = with_choice(preset, choice)
        return Tuned(candidate, tuple(outcomes(candidate, model, starts)))

    def is_certified(one: Tuned) -> bool:
        return verify(one.preset, model, samples=_SAMPLES).certified

    choice = _first(preset)
    best = tried(choice)
    if not math.isfinite(best.mean_s) or not is_certified(best):
        raise InputError(
            f"preset '{preset.name}': its nominal cell does not charge, or not certified, with the "
            "gains that the search begins with; see 'bms verify'"
        )
    for step in STEPS:
        has_moved = True
        while has_moved:
            has_moved = False
            for name, factor in _moves(step):
                following = _moved(preset, choice, name, factor)
                if following is None:
                    continue
                told(f"{best.mean_s:.1f} s; {name} x {factor:.3g}")
                candidate = tried(following)
                is_better = candidate.mean_s < best.mean_s * (1.0 - LEAST_GAIN)
                if is_better and is_certified(candidate):
                    choice, best, has_moved = following, candidate, True
    return best


def _first(preset: Preset) -> Choice:
    larger_per_s, smaller_per_s = preset.gains.surface_roots_per_s
    return Choice(
        preset.gains.alpha1_per_s,
        1.0,
        1.0,
        smaller_per_s / (larger_per_s + smaller_per_s),
        preset.limits.current_growth_A_per_s,
    )


def _moves(step: float) -> list[tuple[str, float]]:
    return [(field.name, factor) for field in fields(Choice) for factor in (step, 1.0 / step)]


def _moved(preset: Preset, choice: Choice, name: str, factor: float) -> Choice | None:
    """The choice with one of its numbers times a factor, within bounds; None where it is there."""
    low, high = {
        "alpha1_per_s": (1e-3, 1.0),
        "core": (1.0, 20.0),
        "surface": (0.2, 5.0),
        "share": (0.02, 0.5),
        "growth_A_per_s": (1e-3, most_growth_A_per_s(preset)),
    }[name]
    before = getattr(choice, name)
    after = min(max(before * factor, low), high)
    return None if after == before else replace(choice, **{name: after})


def _neutral_per_s(preset: Preset) -> float:
    """alpha4 with which A4 is 0: the estimate is in the reversible heat alone."""
    cell = preset.cell
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    return 1.0 / (rc * cc) + 1.0 / (rc * cs) + 1.0 / (rs * cs)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
