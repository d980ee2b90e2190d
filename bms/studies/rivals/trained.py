"""Networks of this project, trained on a plant that no preset describes."""

from __future__ import annotations

from bms.data.cooling import Cooling
from bms.data.datasets import simulated_split
from bms.data.simulate import joined
from bms.kan.settings import TrainingSettings
from bms.model.make import finished_model, network_for_preset
from bms.model.model_file import KanModel, TrainingRecord
from bms.presets import Preset
from bms.progress import Progress


def trained_on(
    preset: Preset,
    cooling: Cooling,
    settings: TrainingSettings,
    count: int | None,
    progress: Progress,
) -> KanModel:
    """Model of the preset's cell under this law of cooling, for comparisons only: without bounds.

    `count` are profiles of each kind in each split (None: as shipped). Raises InputError when the
    width does not fit the inputs.
    """
    training, validation = (
        joined(simulated_split(preset, name, settings.seed, count, settings.lags, cooling).values())
        for name in ("training", "validation")
    )
    network = network_for_preset(preset, training, validation, settings, progress)
    data = f"simulated from preset {preset.name}, cooling {cooling.value}"
    record = TrainingRecord(settings, data, None, {})
    return finished_model(network, record, {}, {}, None, None)
