"""The paper's figures beside ours, with the difference and what most likely causes it."""

from __future__ import annotations

from dataclasses import dataclass

from bms.model import load_shipped_model
from bms.presets import Preset
from bms.studies.paper_fit.figures import FIGURES
from bms.studies.paper_fit.fit import CORE_TIME_CONSTANT_S, FREE_PARAMETERS
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.report.figures import seconds_by_constraint
from hil_sim.run.settings import ControllerKind
from hil_sim.studies.reproduction.margins import SINGLE_MARGINS
from hil_sim.studies.reproduction.runs import DISTURBANCES, Case, Results

PAPER_KAN_RMSE_K = 0.0417
"""Source: paper, section "Simulation results", performance of KAN."""

_CONTROLLERS = {"KAN-rCBF": ControllerKind.KAN_RCBF, "S-CBF": ControllerKind.S_CBF}
_KEYS = {
    "core peak": "max_core_temperature_K",
    "surface peak": "max_surface_temperature_K",
    "time to full": "charge_time_s",
    "first derating": "first_derate_s",
}
_SHARE_OF_GAP_EXPLAINED = 0.2
_SAME_CELL_SHARE = 0.01


@dataclass(frozen=True)
class PaperComparison:
    """A figure of the paper and ours under each disturbance; None for what did not happen.

    The difference is that without disturbance; a tolerance of None means that there is no target.
    """

    name: str
    unit: str
    paper: float
    ours: tuple[float | None, ...]
    tolerance: float | None
    cause: str

    @property
    def difference(self) -> float | None:
        """Ours less the paper's, without disturbance."""
        return None if self.ours[0] is None else self.ours[0] - self.paper

    @property
    def within(self) -> bool | None:
        """Whether the difference is within the tolerance, None without a tolerance."""
        if self.tolerance is None:
            return None
        return self.difference is not None and abs(self.difference) <= self.tolerance


def compare_with_paper(preset: Preset, results: Results) -> list[PaperComparison]:
    """The paper's seven figures, the ratio of charging times, and the error of the estimate."""
    rows = []
    for figure in FIGURES:
        label, _, quantity = figure.name.partition(" ")
        controller, key = _CONTROLLERS[label], _KEYS[quantity]
        ours = tuple(
            _value(results, Case(preset.name, controller, noise), key) for noise in DISTURBANCES
        )
        cause = _cause(preset, results, controller, key, figure.paper)
        rows.append(
            PaperComparison(figure.name, figure.unit, figure.paper, ours, figure.tolerance, cause)
        )
    return [*rows, _ratio(preset, results), *_estimate_rows(preset, results)]


def _time_ratio(preset: Preset, results: Results, disturbance: DisturbanceKind) -> float | None:
    """Charging time of KAN-rCBF over that of S-CBF, None unless both came to the end."""
    robust_s, surface_s = (
        _value(results, Case(preset.name, kind, disturbance), "charge_time_s")
        for kind in _CONTROLLERS.values()
    )
    return None if robust_s is None or surface_s is None else robust_s / surface_s


def _ratio(preset: Preset, results: Results) -> PaperComparison:
    times_s = {figure.name: figure.paper for figure in FIGURES}
    paper = times_s["KAN-rCBF time to full"] / times_s["S-CBF time to full"]
    ours = tuple(_time_ratio(preset, results, noise) for noise in DISTURBANCES)
    return PaperComparison(
        "KAN-rCBF / S-CBF time", "", paper, ours, None, "follows from both times"
    )


def _estimate_rows(preset: Preset, results: Results) -> list[PaperComparison]:
    in_charge = tuple(
        _value(results, Case(preset.name, disturbance=noise), "kan_rmse_K")
        for noise in DISTURBANCES
    )
    model = load_shipped_model(preset.name)
    held_out_K = model.errors["test"].overall.rmse_K
    profiles = model.training.profiles["test"]
    return [
        PaperComparison(
            "KAN RMSE, this charge",
            "K",
            PAPER_KAN_RMSE_K,
            in_charge,
            None,
            "cell, start and cooling of the paper's charge are not published",
        ),
        PaperComparison(
            "KAN RMSE, held out",
            "K",
            PAPER_KAN_RMSE_K,
            (held_out_K,),
            None,
            f"the paper does not say over which samples; ours are {profiles} unseen profiles",
        ),
    ]


def _value(results: Results, case: Case, key: str) -> float | None:
    value: float | None = getattr(results[case].summary, key)
    return value


def _cause(
    preset: Preset, results: Results, controller: ControllerKind, key: str, paper: float
) -> str:
    """The margin of ours without which the figure comes nearest to the paper's, else the cell."""
    ours = _value(results, Case(preset.name, controller), key)
    if ours is None:
        return "the charge did not come to that"
    cell = _cell_cause(preset, results, controller)
    if controller is not ControllerKind.KAN_RCBF:
        return cell
    changed = {
        margin.name: value
        for margin in SINGLE_MARGINS
        if not margin.in_paper
        and (value := _value(results, Case(preset.name, without=margin), key)) is not None
    }
    nearest = min(changed, key=lambda name: abs(changed[name] - paper), default=None)
    gap = abs(ours - paper)
    if nearest is None or abs(changed[nearest] - paper) > (1.0 - _SHARE_OF_GAP_EXPLAINED) * gap:
        return cell
    return f"margin '{nearest}', which the paper does not have; without it {changed[nearest]:.2f}"


def _cell_cause(preset: Preset, results: Results, controller: ControllerKind) -> str:
    time_constant_s = preset.cell.core_resistance_K_per_W * preset.cell.core_heat_capacity_J_per_K
    if abs(time_constant_s / CORE_TIME_CONSTANT_S - 1.0) < _SAME_CELL_SHARE:
        return f"what a fit of {len(FREE_PARAMETERS)} parameters leaves"
    seconds = seconds_by_constraint(
        results[Case(preset.name, controller)], preset.timing.sampling_period_s
    )
    limiting = {name: time_s for name, time_s in seconds.items() if name != "none"}
    most = max(limiting, key=limiting.__getitem__, default="nothing")
    return (
        f"another cell: Rc Cc {time_constant_s:.0f} s, the paper's {CORE_TIME_CONSTANT_S:.0f} s; "
        f"limited mostly by {most}"
    )
