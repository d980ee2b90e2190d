"""Simulation of profiles with the cell model, all profiles at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bms.arrays import Array, IntArray, Mask
from bms.cell import CellParameters, CellState, Disturbance, integrate_step
from bms.data.cooling import Cooling
from bms.data.lags import Lags, at_rest, step
from bms.data.profiles import SAMPLE_PERIOD_S, Profiles, joined_profiles
from bms.presets import Preset

PROCESS_NOISE_K_PER_S = 5e-4
_STEPS_PER_SAMPLE = 4
_STEP_S = SAMPLE_PERIOD_S / _STEPS_PER_SAMPLE


@dataclass(frozen=True)
class Samples:
    """Samples of several profiles: inputs (N, n_in), core temperature, profile number, time (N,).

    Inputs are in the estimator's order: current in A, cooling power in W, surface and coolant
    temperature in K, then the lagged ones. Time rises within each profile.
    """

    inputs: Array
    core_temperature_K: Array
    profile: IntArray
    time_s: Array

    def rows(self, rows: slice | Mask) -> Samples:
        """Some of the samples."""
        return Samples(
            self.inputs[rows],
            self.core_temperature_K[rows],
            self.profile[rows],
            self.time_s[rows],
        )

    def renumbered(self, first: int) -> Samples:
        """The same with profile numbers that count from `first`."""
        return replace(self, profile=self.profile - first)


def joined(parts: Iterable[Samples]) -> Samples:
    """All samples in one; profile numbers go on from part to part."""
    collected = list(parts)
    ends = np.cumsum([0, *(part.profile.max() + 1 for part in collected)])
    return Samples(
        np.concatenate([part.inputs for part in collected]),
        np.concatenate([part.core_temperature_K for part in collected]),
        np.concatenate([part.profile + end for part, end in zip(collected, ends)]),
        np.concatenate([part.time_s for part in collected]),
    )


def simulate(
    preset: Preset,
    profiles: Profiles,
    rng: np.random.Generator,
    lags: Lags = (),
    cooling: Cooling = Cooling.LINEAR,
) -> Samples:
    """Samples of every profile from its first step until the cell is full or leaves the box.

    The current of a sample acts until the next one; the thermal rates carry process noise of
    5e-4 N(0, 1) K/s (paper, section "Estimating core temperature using KAN"). Lagged inputs follow
    the four, with filters that begin at rest.
    """
    return simulate_sets(preset, [profiles], [rng], lags, cooling)[0]


def simulate_sets(
    preset: Preset,
    sets: Sequence[Profiles],
    rngs: Sequence[np.random.Generator],
    lags: Lags = (),
    cooling: Cooling = Cooling.LINEAR,
) -> list[Samples]:
    """Samples of several sets of profiles of one length, as `simulate` gives them of each.

    All cells go through the same steps at once, and each set draws its noise by itself.
    """
    profiles = joined_profiles(sets)
    sizes = [len(one.initial_soc) for one in sets]
    ends = np.cumsum(sizes)
    sources = list(zip(rngs, sizes, ends))
    cell, box = preset.cell, preset.operating_box
    start_K = profiles.initial_temperature_K
    state = CellState(profiles.initial_soc, start_K, start_K, start_K)
    filtered = at_rest(lags, len(start_K))
    alive = np.ones(len(start_K), dtype=bool)
    rows, cores, numbers, times_s = [], [], [], []
    for number, wanted_A in enumerate(profiles.wanted_current_A.T):
        current_A = np.maximum(wanted_A, _derated_current_A(cell, state, profiles.core_limit_K))
        inputs = np.stack(
            [
                current_A,
                profiles.cooling_power_W,
                state.surface_temperature_K,
                state.coolant_temperature_K,
            ],
            axis=1,
        )
        low, high = np.transpose(box.ranges())
        alive &= np.all((inputs >= low) & (inputs <= high), axis=1) & (state.soc <= 1.0)
        if not alive.any():
            break
        rows.append(np.hstack([inputs, filtered.T])[alive])
        cores.append(state.core_temperature_K[alive])
        numbers.append(np.flatnonzero(alive))
        times_s.append(np.full(np.count_nonzero(alive), number * SAMPLE_PERIOD_S))
        noise = np.zeros((3, len(start_K)))
        for rng, size, end in sources:
            own = slice(end - size, end)
            if alive[own].any():
                noise[:, own] = PROCESS_NOISE_K_PER_S * rng.standard_normal((3, size))
        for _ in range(_STEPS_PER_SAMPLE):
            before_K = state.surface_temperature_K
            excess_W = cooling.excess_W(cell, state)
            state = integrate_step(
                cell,
                state,
                current_A,
                profiles.cooling_power_W,
                _STEP_S,
                Disturbance(
                    0.0,
                    noise[0],
                    noise[1] - excess_W / cell.surface_heat_capacity_J_per_K,
                    noise[2] + excess_W / cell.coolant_heat_capacity_J_per_K,
                ),
            )
            filtered = step(
                lags, filtered, _STEP_S, current_A, state.surface_temperature_K - before_K
            )
    samples = Samples(*(np.concatenate(part) for part in (rows, cores, numbers, times_s)))
    owner = np.searchsorted(ends, samples.profile, side="right")
    return [
        samples.rows(owner == number).renumbered(end - size)
        for number, (_, size, end) in enumerate(sources)
    ]


def _derated_current_A(cell: CellParameters, state: CellState, core_limit_K: Array) -> Array:
    """Charging current at which dTc/dt = (limit - Tc)/(Rc Cc), as a core barrier would allow.

    Root of the core constraint of the paper without margins; where the surface is above the limit
    already, the current whose reversible and ohmic heat cancel.
    """
    core_K = state.core_temperature_K
    slope = cell.entropic_coefficient_V_per_K * core_K
    spare_W = (core_limit_K - state.surface_temperature_K) / cell.core_resistance_K_per_W
    resistance = cell.ohmic_resistance_ohm
    root = np.sqrt(slope**2 + 4.0 * resistance * np.maximum(spare_W, 0.0))
    current_A: Array = np.minimum((slope - root) / (2.0 * resistance), 0.0)
    return current_A
