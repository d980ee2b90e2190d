"""Linear pieces over an axis, and filters, as columns of a least-squares problem."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from bms.arrays import Array


def hats(points: Array, at: Array) -> Array:
    """Weights (N, P) with which values at the points give a piecewise linear function at (N,)."""
    points = np.asarray(points, dtype=np.float64)
    if len(points) == 1:
        return np.ones((len(at), 1))
    at = np.clip(at, points[0], points[-1])
    below = np.clip(np.searchsorted(points, at, side="right") - 1, 0, len(points) - 2)
    share = (at - points[below]) / (points[below + 1] - points[below])
    weights = np.zeros((len(at), len(points)))
    rows = np.arange(len(at))
    weights[rows, below] = 1.0 - share
    weights[rows, below + 1] += share
    return weights


def bends(points: Array) -> Array:
    """Second differences (P - 2, P) of values at the points, in units of the mean spacing."""
    count = len(points)
    if count < 3:
        return np.zeros((0, count))
    spacing = np.diff(points) / np.mean(np.diff(points))
    rows = np.zeros((count - 2, count))
    for row in range(count - 2):
        left, right = spacing[row], spacing[row + 1]
        rows[row, row : row + 3] = 1.0 / left, -1.0 / left - 1.0 / right, 1.0 / right
    return rows


def bounded_fit(columns: Array, values: Array, low: Array, high: Array) -> Array:
    """Least squares of values (N,) by columns (N, P) within bounds (P,), by way of QR."""
    reduced = np.asarray(np.linalg.qr(np.column_stack([columns, values]), mode="r"))
    # Columns of very different size are brought to one.
    scale = np.maximum(np.linalg.norm(reduced[:, :-1], axis=0), 1e-12)
    fit = lsq_linear(
        reduced[:, :-1] / scale, reduced[:, -1], (low * scale, high * scale), method="trf"
    )
    return np.asarray(np.clip(fit.x / scale, low, high))


def relaxed(time_s: Array, current_A: Array, time_constant_s: float) -> Array:
    """Current (N,) after a first-order lag; a row's current ends at the row; at rest before it."""
    shares = np.exp(-np.diff(time_s) / time_constant_s)
    filtered, now = [0.0], 0.0
    for share, drive in zip(shares.tolist(), current_A[1:].tolist()):
        now = drive + (now - drive) * share
        filtered.append(now)
    return np.array(filtered)
