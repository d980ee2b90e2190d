"""All bounds of one network, and e_max from them."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.bounds.conformal import CONFIDENCE, over_blocks, over_profiles
from bms.bounds.readings import measurement_error_K
from bms.bounds.record import ErrorBounds
from bms.bounds.theorem import theorem_bound
from bms.bounds.worst_case import Effort, worst_case
from bms.bus_signals import BusQuantisation
from bms.data.simulate import Samples
from bms.kan.network import Network
from bms.presets import Preset
from bms.progress import Progress, part, to_nobody
from bms.tables.rounding import PERIOD_S, arithmetic_error_K, fits_firmware

FULL_EFFORT = Effort()
_SHARE_OF_SWEEP = 0.3
"""Of the time; the search takes the rest."""
SEARCH_SPREAD_K = 2e-3
"""By how much searches with other seeds, and so other noise, find more (docs/error-bound.md)."""


def bounds_for_preset(
    network: Network,
    preset: Preset,
    training: Samples,
    held_out: Samples,
    seed: int,
    effort: Effort = FULL_EFFORT,
    confidence: float = CONFIDENCE,
    progress: Progress = to_nobody,
) -> ErrorBounds:
    """Bounds for a network trained on profiles simulated from a preset.

    `held_out` are whole profiles that it was not trained on. InputError when they are too few for
    the confidence.
    """
    error_K = _errors_K(network, held_out)
    return ErrorBounds(
        theorem_bound(network, training, seed, part(progress, 0.0, _SHARE_OF_SWEEP)),
        worst_case(network, preset, seed, effort, part(progress, _SHARE_OF_SWEEP, 1.0)),
        over_profiles(error_K, held_out.profile, confidence),
        float(np.abs(error_K).max()),
    )


def bounds_for_recording(
    network: Network,
    training: Samples,
    held_out: Samples,
    seed: int,
    confidence: float = CONFIDENCE,
    progress: Progress = to_nobody,
) -> ErrorBounds:
    """Bounds for a network trained on measurements; `held_out` are rows in time order.

    The smooth fit of a recording may err more where it was fitted than on a quiet rest of it, so
    the largest error is that of both parts. InputError when the rows are too few.
    """
    error_K = _errors_K(network, held_out)
    largest_K = max(np.abs(error_K).max(), np.abs(_errors_K(network, training)).max())
    return ErrorBounds(
        theorem_bound(network, training, seed, progress),
        None,
        over_blocks(error_K, confidence),
        float(largest_K),
    )


def error_bound_parts_K(
    network: Network, bounds: ErrorBounds, held_out: Samples, preset: Preset | None
) -> dict[str, float]:
    """What e_max is the sum of, in K.

    "estimate" is the bound in use; "search" is what other seeds of the search may find beyond it;
    "sensors" is what errors of the readings add, which measured data hold already (no preset);
    "arithmetic" is float32 and the tables in the firmware, none for a network that it cannot hold.
    """
    parts_K = {"estimate": bounds.used_K}
    if preset is not None:
        parts_K["search"] = SEARCH_SPREAD_K
        parts_K["sensors"] = measurement_error_K(
            network, held_out.inputs, preset.sensors, BusQuantisation()
        )
    if fits_firmware(network):
        period_s = PERIOD_S if preset is None else preset.timing.sampling_period_s
        parts_K["arithmetic"] = arithmetic_error_K(network, period_s)
    return parts_K


def _errors_K(network: Network, samples: Samples) -> Array:
    return network.evaluate(samples.inputs)[0] - samples.core_temperature_K
