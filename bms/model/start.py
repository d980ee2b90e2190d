"""Whether a model knows the state in which a preset's charge begins; if not, none ever begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.data.lags import at_rest
from bms.kan.network import INPUT_NAMES
from bms.model.model_file import KanModel
from bms.presets import Preset


@dataclass(frozen=True)
class UnknownStart:
    """Why the firmware gives no current at plug-in: inputs by name there, and what is known."""

    reason: str
    inputs: dict[str, float]
    change: str


def unknown_start(preset: Preset, model: KanModel) -> UnknownStart | None:
    """What of a preset's start the model was not trained on; None where there is nothing.

    Outside of what its estimator was trained on the firmware stops, so no charge would begin. A
    family goes on by its observer there, and is not looked at.
    """
    if preset.cell.interval is not None:
        return None
    network, initial = model.network, preset.initial
    temperature_K = initial.temperature_K
    start = dict(zip(INPUT_NAMES, (0.0, initial.cooling_power_W, temperature_K, temperature_K)))
    values = [*start.values(), *at_rest(network.lags, 1)[:, 0]]
    center, half = np.asarray(network.input_center), np.asarray(network.input_half_range)
    for name, value, low, high in zip(INPUT_NAMES, values, center - half, center + half):
        if not low <= value <= high:
            return UnknownStart(
                f"the model knows {name} from {low:g} to {high:g} only, and a charge of this "
                f"preset begins at {value:g}: the firmware would give 0 A for ever",
                start,
                "train on data in which it varies as far, or change [initial] of the preset",
            )
    if network.evaluate(np.asarray([values]))[1][0]:
        return None
    return UnknownStart(
        "the model was trained on no rest at the temperature and cooling at which a charge of this "
        "preset begins: the firmware would give 0 A for ever",
        start,
        "train on data that contain it, or change [initial] of the preset",
    )
