"""Comparison on simulated profiles that no training has seen."""

from __future__ import annotations

import numpy as np

from bms.data.cooling import Cooling
from bms.data.datasets import simulated_split
from bms.data.lags import Lags
from bms.data.profiles import SAMPLE_PERIOD_S
from bms.data.simulate import joined
from bms.presets import Preset
from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.problem import Problem
from bms.studies.rivals.readings import as_read
from bms.studies.rivals.thermal import FilterNoise, reading_std

_RESISTANCE_START = 1.2
_RESISTANCE_START_STD = 0.2
_RESISTANCE_DRIFT_PER_SQRT_S = 1e-4
_SENSOR_STREAM = 101


def simulated_problem(
    preset: Preset,
    seed: int,
    lags: Lags,
    count: int | None = None,
    cooling: Cooling = Cooling.LINEAR,
) -> Problem:
    """Whole profiles of the preset, `count` of each kind in each split (None: as shipped).

    With another law of cooling than the cell model's the filters know nothing of it. They are given
    the true cell, except that the extended one believes in a resistance a
    fifth too high at first; uncertainties and sensors are those of the preset.
    """
    training = joined(simulated_split(preset, "training", seed, count, lags, cooling).values())
    validation = joined(simulated_split(preset, "validation", seed, count, lags, cooling).values())
    kinds = simulated_split(preset, "evaluation", seed, count, lags, cooling)
    samples = joined(kinds.values())
    rng = np.random.default_rng([seed, _SENSOR_STREAM])
    test = Sequences.of(samples)
    constant_rows = len(kinds["constant"].core_temperature_K)
    constant = np.arange(len(test.inputs)) < constant_rows
    first_dynamic = int(np.searchsorted(test.starts, constant_rows))
    bounds = preset.uncertainty
    return Problem(
        title=_title(preset, cooling),
        training=training,
        before_validation=training,
        validation=validation,
        floor_choice=validation,
        floor_chosen_by="validation data",
        test=test,
        scopes={"constant": constant, "dynamic": ~constant, "all": np.ones_like(constant)},
        counted="all",
        read=Sequences.of(as_read(preset.sensors, samples, lags, rng)),
        lags=lags,
        cell=preset.cell,
        cell_origin="the true cell"
        if cooling is Cooling.LINEAR
        else "the cell as its model has it",
        noise=FilterNoise(
            core_K_per_s=bounds.core_K_per_s,
            surface_K_per_s=bounds.surface_K_per_s,
            reading_K=reading_std(preset.sensors.surface_temperature_K),
            start_K=0.0,
            resistance_start=_RESISTANCE_START_STD,
            resistance_drift_per_sqrt_s=_RESISTANCE_DRIFT_PER_SQRT_S,
        ),
        tuned=None,
        period_s=SAMPLE_PERIOD_S,
        resistance_start=_RESISTANCE_START,
        trace_profile=first_dynamic + int(np.argmax(np.diff(test.starts[first_dynamic:]))),
        trace_title="the longest dynamic profile",
    )


def _title(preset: Preset, cooling: Cooling) -> str:
    plant = "" if cooling is Cooling.LINEAR else f" with {cooling.value}"
    return f"preset {preset.name}{plant}, whole profiles that no training has seen"
