"""Draws of a preset's whole family: cell, plug-in, charger, sensors and disturbance."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.special import exprel

from bms.barrier.family import family_of, time_constant_factor
from bms.cell import CellFactors, CellParameters, CellState, Polarisation, scaled
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.native.cell_fields import thermal_matrix_per_s
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.sensors import Readings
from hil_sim.plant.true_cell import COOLING_BAND_K, TrueCell

EMPTY_SOC, HALF_FULL_SOC = (0.0, 0.5), (0.5, 0.9)
HALF_FULL_SHARE = 0.25
"""What the charger says at plug-in, and the share of the runs that begin with the latter."""
HOT_CORE_SHARE = 1.0 / 3.0
COLDEST_ABOVE_BOX_K, HOTTEST_BELOW_LIMIT_K = 2.0, 4.0
LEAST_COOLING = 2.0
"""Times the heat of the disturbance."""
FLOOR_BELOW_LIMIT_K = 20.0
"""A cooler's thermostat is set at least this far below the limit of the core."""
END_SHARE, VERTEX_SHARE = 0.25, 0.125
"""Each quantity is at an end of its interval in a quarter of the runs; in an eighth, all are."""

_KINDS = (DisturbanceKind.GAUSSIAN, DisturbanceKind.BANG_BANG, DisturbanceKind.UPWARD)
_ROUNDING_K = 1e-9
_ATTEMPTS = 1000


@dataclass(frozen=True)
class RealDraw:
    """One cell of the family at plug-in; the disturbance has all of the preset's bounds."""

    factors: CellFactors
    cell: TrueCell
    disturbance: DisturbanceKind
    disturbance_share: float = 1.0

    def true_cell(self, preset: Preset) -> TrueCell:
        """The cell with its charger and sensors."""
        return self.cell


def draw_real(preset: Preset, max_time_s: float, rng: np.random.Generator) -> RealDraw:
    """Draw of a run; every quantity is uniform in its interval, or at one of its ends.

    A start at which the cell would cross a temperature limit at 0 A within the time limit is drawn
    anew, because no charge control can prevent that. Raises InputError without a family, or when
    hardly any start is possible.
    """
    draws = _Draws(preset, rng)
    factors = draws.factors()
    cell = scaled(preset.cell, factors)
    kind = _KINDS[int(rng.integers(len(_KINDS)))]
    told_soc, true_soc = draws.socs()
    for _ in range(_ATTEMPTS):
        state, cooling_W = draws.start(cell, true_soc)
        if _keeps_limits_at_rest(preset, cell, state, cooling_W, max_time_s):
            break
    else:
        raise InputError(
            f"preset '{preset.name}': hardly a start keeps the limits at 0 A for {max_time_s:g} s; "
            "shorten --max-time-s or plug_in.coolant_offset_K"
        )
    tolerance = preset.supply.tolerance
    return RealDraw(
        factors=factors,
        cell=TrueCell(
            cell=cell,
            state=state,
            cooling_power_W=cooling_W,
            plug_in_soc=told_soc,
            polarisation_V=draws.polarisation(cell),
            biases=draws.biases(),
            supply_tolerance=draws.pick(-tolerance, tolerance),
            supply_lag_s=draws.pick(0.0, preset.supply.lag_s),
            coolant_floor_K=draws.coolant_floor_K(state.coolant_temperature_K),
        ),
        disturbance=kind,
    )


class _Draws:
    """The random quantities of one run, one after the other."""

    def __init__(self, preset: Preset, rng: np.random.Generator) -> None:
        self._preset, self._rng = preset, rng
        self._interval = family_of(preset)
        self._is_vertex = rng.uniform() < VERTEX_SHARE

    def pick(self, low: float, high: float) -> float:
        """Uniform, or one of the ends."""
        at_end, upper = self._rng.uniform() < END_SHARE, self._rng.uniform() < 0.5
        anywhere = float(self._rng.uniform(low, high))
        if at_end or self._is_vertex:
            return high if upper else low
        return anywhere

    def factors(self) -> CellFactors:
        """Every factor and addition of the family, and one on the branches' time constants."""
        interval = self._interval
        slowest = time_constant_factor(self._preset.cell, interval)
        bounds = {field.name: getattr(interval, field.name) for field in fields(interval)}
        del bounds["longest_relaxation_s"]
        ends = {
            name: value if isinstance(value, tuple) else (-value, value)
            for name, value in bounds.items()
        }
        ends["relaxation"] = 1.0 / slowest, slowest
        return CellFactors(**{name: self.pick(*end) for name, end in ends.items()})

    def socs(self) -> tuple[float, float]:
        """State of charge as the charger says it, and as it is."""
        half_full = self._rng.uniform() < HALF_FULL_SHARE
        told = float(self._rng.uniform(*(HALF_FULL_SOC if half_full else EMPTY_SOC)))
        error = self._preset.plug_in.soc_error
        return told, min(max(told + self.pick(-error, error), 0.0), 1.0)

    def start(self, cell: CellParameters, soc: float) -> tuple[CellState, float]:
        """State with temperatures, and a cooling power that is more than the disturbance heats.

        With less of it a warm cell gets ever hotter at 0 A, whatever the charge control does.
        """
        preset, box = self._preset, self._preset.operating_box
        limits, plug_in = preset.limits, preset.plug_in
        limit_K = min(limits.max_core_temperature_K, limits.max_surface_temperature_K)
        surface_K = float(
            self._rng.uniform(
                box.surface_temperature_K[0] + COLDEST_ABOVE_BOX_K, limit_K - HOTTEST_BELOW_LIMIT_K
            )
        )
        low_K, high_K = box.coolant_temperature_K
        offset_K = self.pick(-plug_in.coolant_offset_K, plug_in.coolant_offset_K)
        coolant_K = min(max(surface_K + offset_K, low_K), high_K)
        excess_K = self.pick(0.0, min(plug_in.core_excess_K, limit_K - surface_K))
        is_hot = self._rng.uniform() < HOT_CORE_SHARE
        core_K = min(surface_K + excess_K, limit_K) if is_hot else surface_K
        least_W = LEAST_COOLING * disturbance_W(preset, cell)
        cooling_W = self.pick(least_W, box.cooling_power_W[1])
        return CellState(soc, core_K, surface_K, coolant_K), cooling_W

    def coolant_floor_K(self, coolant_temperature_K: float) -> float:
        """Temperature down to which the coolant is cooled, below that at plug-in."""
        coldest_K = self._preset.operating_box.coolant_temperature_K[0] + COLDEST_ABOVE_BOX_K
        warmest_K = self._preset.limits.max_core_temperature_K - FLOOR_BELOW_LIMIT_K
        highest_K = min(coolant_temperature_K - COOLING_BAND_K, warmest_K)
        return self.pick(coldest_K, max(highest_K, coldest_K))

    def polarisation(self, cell: CellParameters) -> Polarisation:
        """Voltages of the branches, which together are within the preset's bound.

        None is more than what the strongest current can bring about in it.
        """
        if not cell.branches:
            return ()
        bound_V = self._preset.plug_in.polarisation_V
        total_V = self.pick(-bound_V, bound_V)
        shares = self._rng.dirichlet(np.ones(len(cell.branches))).tolist()
        strongest_A = -self._preset.limits.reference_current_A
        largest_V = [branch.resistance_ohm * strongest_A for branch in cell.branches]
        return tuple(
            min(max(total_V * share, -most_V), most_V) for share, most_V in zip(shares, largest_V)
        )

    def biases(self) -> Readings:
        """A constant error of each sensor, within what its bound leaves beside the noise."""
        bounds = (abs(getattr(self._preset.sensors, name).bias) for name in Readings._fields)
        return Readings(*(self.pick(-bound, bound) for bound in bounds))


def disturbance_W(preset: Preset, cell: CellParameters) -> float:
    """Heat of the disturbance at its bounds in a cell without a current, in W."""
    bounds = preset.uncertainty
    return (
        cell.core_heat_capacity_J_per_K * bounds.core_K_per_s
        + cell.surface_heat_capacity_J_per_K * bounds.surface_K_per_s
        + cell.coolant_heat_capacity_J_per_K * bounds.coolant_K_per_s
    )


def _keeps_limits_at_rest(
    preset: Preset, cell: CellParameters, state: CellState, cooling_W: float, time_s: float
) -> bool:
    """Whether no temperature crosses its limit at 0 A under the disturbance that heats most.

    Conduction alone is a positive system, so that the largest disturbance gives the highest
    temperatures. Its matrix has real eigenvalues, one of which is 0.
    """
    bounds = preset.uncertainty
    heating_K_per_s = np.array(
        [
            bounds.core_K_per_s,
            bounds.surface_K_per_s,
            bounds.coolant_K_per_s - cooling_W / cell.coolant_heat_capacity_J_per_K,
        ]
    )
    eigenvalues, modes = np.linalg.eig(thermal_matrix_per_s(cell))
    rates_per_s = np.minimum(eigenvalues.real, 0.0)
    start, heating = np.linalg.solve(modes, np.array([state[1:], heating_K_per_s]).T).real.T
    times_s = np.concatenate([np.arange(0.0, 100.0), np.arange(100.0, time_s + 30.0, 30.0)])
    exponents = np.multiply.outer(times_s, rates_per_s)
    lasting_s = times_s[:, np.newaxis] * exprel(exponents)
    courses_K = (np.exp(exponents) * start + lasting_s * heating) @ modes.real.T
    limits_K = preset.limits.max_core_temperature_K, preset.limits.max_surface_temperature_K
    return bool(np.all(courses_K[:, :2] <= np.array(limits_K) + _ROUNDING_K))
