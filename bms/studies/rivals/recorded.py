"""Comparison on the last third of a measured recording."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from bms.data.datasets import training_rows
from bms.data.lags import Lags
from bms.data.measurements import Measurements, read_measurements
from bms.errors import InputError
from bms.identification import identify
from bms.presets import Preset
from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.problem import Problem
from bms.studies.rivals.thermal import FilterNoise, reading_std
from bms.studies.rivals.tuning import FittedRows, tuned_filter, tuned_noise

_VALIDATION_SHARE = 0.25
_UNEVEN = 0.01
_START = FilterNoise(
    core_K_per_s=1e-2,
    surface_K_per_s=1e-2,
    reading_K=1e-2,
    start_K=0.1,
    resistance_start=0.2,
    resistance_drift_per_sqrt_s=1e-3,
)


def recorded_problem(path: Path, start: Preset, fit_cell: bool, lags: Lags) -> Problem:
    """A recording (CSV), its first two thirds for all fits and the last third for the figures.

    The filters run from the beginning of the recording. Their cell is that of `start`, fitted by
    `bms.identification` when `fit_cell` is set; the noise that they reckon with is that which
    serves the first two thirds best. One more is tuned to the core as a whole. Raises InputError
    for uneven sampling or too few rows.
    """
    recording = read_measurements(path)
    rows = len(recording.time_s)
    cut = training_rows(rows)
    period_s = _period_s(path, recording)
    samples = recording.samples(lags)
    test = Sequences.of(samples)
    validated = round((1.0 - _VALIDATION_SHARE) * cut)
    fitted = np.arange(rows) < cut
    try:
        cell = identify(recording, start, slice(0, cut)).cell if fit_cell else start.cell
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    surface = start.sensors.surface_temperature_K
    rows_to_fit = FittedRows(test, fitted, period_s)
    start_noise = dataclasses.replace(_START, reading_K=reading_std(surface))
    noise = tuned_noise(cell, start_noise, rows_to_fit)
    return Problem(
        title=f"{path.name}, last third of {rows} rows",
        training=samples.rows(slice(cut)),
        before_validation=samples.rows(slice(validated)),
        validation=samples.rows(slice(validated, cut)),
        floor_choice=samples.rows(slice(cut, None)),
        floor_chosen_by="the last third itself",
        test=test,
        scopes={"fitted two thirds": fitted, "last third": ~fitted},
        counted="last third",
        read=None,
        lags=lags,
        cell=cell,
        cell_origin=f"a cell fitted to the data from preset {start.name}"
        if fit_cell
        else f"the cell of preset {start.name}",
        noise=noise,
        tuned=tuned_filter(cell, noise, rows_to_fit),
        period_s=period_s,
        resistance_start=1.0,
        trace_profile=0,
        trace_title="the whole recording; its first two thirds are fitted",
    )


def _period_s(path: Path, recording: Measurements) -> float:
    steps_s = np.diff(recording.time_s)
    if len(steps_s) < 1:
        raise InputError(f"{path}: one row; give a recording")
    period_s = float(np.median(steps_s))
    uneven = np.flatnonzero(np.abs(steps_s - period_s) > _UNEVEN * period_s)
    if len(uneven):
        raise InputError(
            f"{path}: time_s: the step to row {uneven[0] + 2} is {steps_s[uneven[0]]:g} s and not "
            f"{period_s:g} s; filters need even sampling, resample the recording"
        )
    return period_s
