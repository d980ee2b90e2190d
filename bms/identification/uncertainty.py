"""Standard errors and correlations of a least-squares fit to recordings."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array

_BLOCKS = 24
_SMALLEST_SINGULAR_VALUE = 1e-12


def covariance(jacobian: Array, residuals_K: Array, smallest_noise_K: float) -> Array:
    """Covariance (P, P) of parameters, from the Jacobian (2, N, P) and the residuals (2, N).

    The first axis is core and surface. The larger of two estimates: the classical one with the
    residuals as white noise of at least `smallest_noise_K`, and the one from the scatter between
    24 stretches of the recording, which counts errors of the model that last for minutes.
    A combination of parameters without effect gets a huge variance.
    """
    parameters = jacobian.shape[-1]
    flat = jacobian.reshape(-1, parameters)
    _, singular, rotation = np.linalg.svd(flat, full_matrices=False)
    singular = np.maximum(singular, _SMALLEST_SINGULAR_VALUE)
    bread = (rotation.T / singular**2) @ rotation
    freedom = max(residuals_K.size - parameters, 1)
    noise_K = max(float(np.sqrt(np.sum(residuals_K**2) / freedom)), smallest_noise_K)
    classical: Array = noise_K**2 * bread
    scores = np.stack(
        [
            np.einsum("crp,cr->p", jacobian[:, rows], residuals_K[:, rows])
            for rows in np.array_split(np.arange(residuals_K.shape[1]), _BLOCKS)
        ]
    )
    clustered: Array = bread @ (scores.T @ scores) @ bread * _BLOCKS / (_BLOCKS - 1)
    larger = np.sqrt(np.maximum(np.diag(clustered) / np.diag(classical), 1.0))
    # One matrix scaled on both sides keeps correlations and stays positive definite.
    scaled: Array = classical * larger[:, None] * larger
    return scaled


def correlation(matrix: Array) -> Array:
    """Correlations of a covariance matrix (P, P)."""
    errors = np.sqrt(np.diag(matrix))
    scaled: Array = matrix / errors[:, None] / errors
    return scaled
