"""Open-circuit voltage, ohmic resistance and branches of a cell from currents and voltages."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from bms.arrays import Array, IntArray
from bms.cell import OpenCircuitVoltage
from bms.cell.tables import Branch
from bms.identification.pieces import bends, bounded_fit, hats, relaxed

OCV_POINTS = np.array(
    [0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08]
    + [round(0.1 + 0.025 * k, 3) for k in range(36)]
    + [0.99, 1.0]
)
RESISTANCE_SOC = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
_TIME_CONSTANTS_S = np.geomspace(4.0, 1200.0, 15)
ACTIVATIONS_K = np.array([0.0, 300.0, 600.0, 900.0, 1200.0, 1600.0, 2000.0, 2500.0])
"""Activation energies of the resistance over the gas constant."""
REFERENCE_K = 298.15
_LARGEST_BRANCHES = 3
_APART = 2.5
"""Time constants nearer to one another than this factor are one."""
_NOTICEABLE = 0.005
"""Share by which a branch more has to better the fit, else it is left out."""
_LEAST_RISE_V = 2e-4
_LEAST_OHM, _MOST_OHM = 1e-5, 1.0
_OCV_STIFFNESS, _RESISTANCE_STIFFNESS = 0.3, 400.0
_REST_SHARE, _LONG_REST_S = 0.02, 500.0
_ROUNDS = 3
_OTHER_SPECIMEN = 0.25
_STEP_SHARE = 0.6
"""Of the resistance of steps, which the ohmic one is not below."""
_MODEL_ERROR_V = 2e-3
_ROWS_EACH = 3000.0
_STEP = 0.15
"""Of the current of 1C, by which a step begins."""
_EARLY_S = 5.0
_LIKE_K = 12.0


@dataclass(frozen=True)
class ElectricalRecord:
    """What the fit needs of one recording, arrays (N,); the current is negative while charging."""

    name: str
    time_s: Array
    current_A: Array
    voltage_V: Array
    soc: Array
    core_K: Array
    specimen: int = 0
    """Which of several cells of the type was measured; 0 is the one that the preset describes."""


@dataclass(frozen=True)
class ElectricalFit:
    """Fitted electrical part, and the root mean square of what is left by recording, in V.

    The ohmic resistance is a function of the state of charge times exp(a (1/T - 1/298.15 K)), with
    a the `activation_K`. `specimens` are the factors on all resistances of the cells measured.
    """

    ocv: OpenCircuitVoltage
    ohm: tuple[float, ...]
    activation_K: float
    branches: tuple[Branch, ...]
    specimens: Mapping[int, float]
    rmse_V: tuple[float, ...]

    def resistance_ohm(self, temperature_K: Array, soc: Array) -> Array:
        """Ohmic resistance of the described cell in ohm."""
        return np.interp(soc, RESISTANCE_SOC, self.ohm) * growth(self.activation_K, temperature_K)


def growth(activation_K: float, temperature_K: Array) -> Array:
    """Factor on a resistance at 298.15 K by Arrhenius' law."""
    return np.asarray(np.exp(activation_K * (1.0 / temperature_K - 1.0 / REFERENCE_K)))


def fit_electrical(
    records: Sequence[ElectricalRecord],
    slow: Sequence[int],
    capacity_Ah: float,
    activations_K: Array = ACTIVATIONS_K,
) -> ElectricalFit:
    """Fit open-circuit voltage and overpotential in turn, the latter linear but for a grid search.

    The open-circuit voltage is that of the slow recordings (places in `records`) less their own
    overpotential. What other recordings rest at beside it is taken out of them. A row of the
    overpotential has an error of 2 mV, and of 2 mV for each C/5; a recording counts half by time
    and half by the logarithm of the time since a step. Another specimen counts a quarter, with the
    ratio of its steps to those of the described cell as a factor on its resistances.
    """
    specimens = _specimens(records, capacity_Ah)
    fit = ElectricalFit(
        _open_circuit([(records[k], np.zeros_like(records[k].soc)) for k in slow]),
        (0.0,) * len(RESISTANCE_SOC),
        0.0,
        (),
        specimens,
        (),
    )
    for _ in range(_ROUNDS):
        fit = _fit_overpotential(fit, records, capacity_Ah, activations_K)
        parts = [(records[k], _overpotential_V(fit, records[k])) for k in slow]
        fit = replace(fit, ocv=_open_circuit(parts))
    rmse_V = tuple(
        float(np.sqrt(np.mean((voltage_V(fit, record) - record.voltage_V) ** 2)))
        for record in records
    )
    return replace(fit, rmse_V=rmse_V)


def _open_circuit(parts: Sequence[tuple[ElectricalRecord, Array]]) -> OpenCircuitVoltage:
    """Rising piecewise linear voltage through the slow recordings less their overpotential."""
    columns, values = [], []
    for record, overpotential_V in parts:
        weight = np.sqrt(np.gradient(record.time_s) / np.ptp(record.time_s) * _ROWS_EACH)
        columns.append(_rises(record.soc) * weight[:, None])
        values.append((record.voltage_V - overpotential_V) * weight)
    points = len(OCV_POINTS)
    stiff = bends(OCV_POINTS) @ np.tril(np.ones((points, points))) * _OCV_STIFFNESS
    low = np.concatenate([[0.1], np.full(points - 1, _LEAST_RISE_V)])
    high = np.concatenate([[6.0], np.full(points - 1, 3.0)])
    found = bounded_fit(
        np.concatenate([*columns, stiff]),
        np.concatenate([*values, np.zeros(len(stiff))]),
        low,
        high,
    )
    voltage = np.round(np.cumsum(found), 5)
    return OpenCircuitVoltage(tuple(OCV_POINTS.tolist()), tuple(voltage.tolist()))


def rest_offset_V(fit: ElectricalFit, record: ElectricalRecord, capacity_Ah: float) -> Array:
    """What a recording's long rests (N,) lie beside the open-circuit voltage, linear between."""
    resting = np.abs(record.current_A) < _REST_SHARE * capacity_Ah
    ends = np.flatnonzero(resting & ~np.append(resting[1:], False))
    begins = np.flatnonzero(resting & ~np.append(False, resting[:-1]))
    long_rests = [
        int(end)
        for begin, end in zip(begins, ends)
        if record.time_s[end] - record.time_s[begin] > _LONG_REST_S
    ]
    if not long_rests:
        return np.zeros_like(record.soc)
    offset_V = (record.voltage_V - fit.ocv(record.soc))[long_rests]
    return np.asarray(np.interp(record.time_s, record.time_s[long_rests], offset_V))


def polarised_V(fit: ElectricalFit, time_s: Array, current_A: Array) -> Array:
    """Voltage (N,) of all branches together, from rest."""
    total = np.zeros_like(time_s)
    for branch in fit.branches:
        total -= branch.resistance_ohm * relaxed(time_s, current_A, branch.time_constant_s)
    return total


def voltage_V(fit: ElectricalFit, record: ElectricalRecord) -> Array:
    """Terminal voltage (N,) by the fit."""
    return np.asarray(fit.ocv(record.soc) + _overpotential_V(fit, record))


def _overpotential_V(fit: ElectricalFit, record: ElectricalRecord) -> Array:
    factor = fit.specimens.get(record.specimen, 1.0)
    ohmic = -record.current_A * fit.resistance_ohm(record.core_K, record.soc)
    return np.asarray(factor * (ohmic + polarised_V(fit, record.time_s, record.current_A)))


def _weights(record: ElectricalRecord, capacity_Ah: float) -> Array:
    weight = 1.0 / (_MODEL_ERROR_V + 2e-3 * np.abs(record.current_A) / (0.2 * capacity_Ah))
    # A recording counts as one, half by time and half by the logarithm of the time since a step,
    # so that the seconds after a step are not lost among hours of rest.
    span_s = np.minimum(np.gradient(record.time_s), 10.0)
    steps = np.abs(np.diff(record.current_A, prepend=record.current_A[0])) > _STEP * capacity_Ah
    begun_s = np.maximum.accumulate(np.where(steps, record.time_s, record.time_s[0]))
    early = span_s / (record.time_s - begun_s + _EARLY_S)
    share = 0.5 * span_s / np.sum(span_s) + 0.5 * early / np.sum(early)
    counts = _OTHER_SPECIMEN if record.specimen else 1.0
    return np.asarray(weight * np.sqrt(counts * share * _ROWS_EACH))


def step_rows(record: ElectricalRecord, capacity_Ah: float) -> IntArray:
    """Rows at which the current has changed by 0.15 C or more within 5 s."""
    change = np.abs(np.diff(record.current_A)) > _STEP * capacity_Ah
    return np.flatnonzero(change & (np.diff(record.time_s) < _EARLY_S)) + 1


def step_ohm(record: ElectricalRecord, capacity_Ah: float) -> Array:
    """Resistance of each step of the current, by the two rows around it."""
    rows = step_rows(record, capacity_Ah)
    return np.asarray(
        -(record.voltage_V[rows] - record.voltage_V[rows - 1])
        / (record.current_A[rows] - record.current_A[rows - 1])
    )


def _specimens(records: Sequence[ElectricalRecord], capacity_Ah: float) -> dict[int, float]:
    """Factors by steps at more than half full and, where there are some, near one temperature."""
    ohm: dict[int, list[float]] = {record.specimen: [] for record in records}
    near_K = float(np.median([np.median(r.core_K) for r in records if r.specimen == 0]))
    for record in records:
        rows = step_rows(record, capacity_Ah)
        is_like = (record.soc[rows] > 0.5) & (np.abs(record.core_K[rows] - near_K) < _LIKE_K)
        ohm[record.specimen] += step_ohm(record, capacity_Ah)[is_like].tolist()
    if not ohm.get(0):
        return dict.fromkeys(ohm, 1.0)
    return {
        number: float(np.median(values) / np.median(ohm[0])) if values and number else 1.0
        for number, values in sorted(ohm.items())
    }


def _fit_overpotential(
    fit: ElectricalFit,
    records: Sequence[ElectricalRecord],
    capacity_Ah: float,
    activations_K: Array,
) -> ElectricalFit:
    target, slow, factors = [], [], []
    for record in records:
        weight = _weights(record, capacity_Ah)
        factor = fit.specimens[record.specimen]
        missing_V = record.voltage_V - fit.ocv(record.soc)
        target.append((missing_V - rest_offset_V(fit, record, capacity_Ah)) * weight)
        lags = [relaxed(record.time_s, record.current_A, tau) for tau in _TIME_CONSTANTS_S]
        slow.append(-factor * weight[:, None] * np.stack(lags, 1))
        factors.append(-factor * record.current_A * weight)
    stiff = bends(RESISTANCE_SOC) * _RESISTANCE_STIFFNESS
    values = np.concatenate([*target, np.zeros(len(stiff))])
    lagged = np.concatenate([*slow, np.zeros((len(stiff), len(_TIME_CONSTANTS_S)))])
    soc = np.concatenate([hats(RESISTANCE_SOC, record.soc) for record in records])
    core_K, drive = np.concatenate([r.core_K for r in records]), np.concatenate(factors)
    tried = []
    for activation_K in activations_K.tolist():
        ohmic = soc * (drive * growth(activation_K, core_K))[:, None]
        columns = np.concatenate([ohmic, stiff])
        chosen, _ = _time_constants(columns, values, lagged)
        together = np.hstack([columns, lagged[:, list(chosen)]])
        low = np.full(together.shape[1], _LEAST_OHM)
        low[: len(RESISTANCE_SOC)] = _least_ohm(records, activation_K, capacity_Ah)
        solution = bounded_fit(together, values, low, np.full(len(low), _MOST_OHM))
        left = values - together @ solution
        tried.append((float(left @ left), activation_K, chosen, solution))
    _, activation_K, chosen, found = min(tried, key=lambda one: one[0])
    states = len(RESISTANCE_SOC)
    return replace(
        fit,
        ohm=tuple(found[:states].tolist()),
        activation_K=activation_K,
        branches=tuple(
            Branch(round(float(r), 6), round(float(tau), 1))
            for r, tau in zip(found[states:], _TIME_CONSTANTS_S[list(chosen)])
        ),
    )


def _least_ohm(
    records: Sequence[ElectricalRecord], activation_K: float, capacity_Ah: float
) -> float:
    """Share of the middle step resistance, brought to the reference temperature."""
    ohm = [
        step_ohm(record, capacity_Ah)
        / growth(activation_K, record.core_K[step_rows(record, capacity_Ah)])
        for record in records
    ]
    steps = np.concatenate(ohm)
    return max(_LEAST_OHM, _STEP_SHARE * float(np.median(steps)) if len(steps) else 0.0)


def _rises(soc: Array) -> Array:
    """Columns (N, P) of the first voltage and of the rises between the points."""
    return np.cumsum(hats(OCV_POINTS, soc)[:, ::-1], axis=1)[:, ::-1]


def _time_constants(fixed: Array, target: Array, slow: Array) -> tuple[tuple[int, ...], float]:
    """Places of the time constants, up to three, that explain most beside the fixed columns."""
    basis, _ = np.linalg.qr(fixed)
    lags = slow - basis @ (basis.T @ slow)
    left = target - basis @ (basis.T @ target)
    reduced = np.asarray(np.linalg.qr(np.column_stack([lags, left]), mode="r"))
    best: tuple[int, ...] = ()
    cost = float(left @ left)
    for count in range(1, _LARGEST_BRANCHES + 1):
        costs = {}
        for places in itertools.combinations(range(slow.shape[1]), count):
            taus = _TIME_CONSTANTS_S[list(places)]
            if np.any(taus[1:] < _APART * taus[:-1]):
                continue
            ohm, distance = nnls(reduced[:, list(places)], reduced[:, -1])
            if np.all(ohm > 0.0):
                costs[places] = float(distance) ** 2
        if not costs:
            break
        better = min(costs, key=lambda places: costs[places])
        if costs[better] > (1.0 - _NOTICEABLE) * cost:
            break
        best, cost = better, costs[better]
    return best, cost
