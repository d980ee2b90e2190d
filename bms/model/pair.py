"""A preset and the model that goes with it."""

from __future__ import annotations

from pathlib import Path

from bms.errors import ModelMismatchError
from bms.kan.network import INPUT_NAMES
from bms.model.model_file import KanModel, load_model, load_shipped_model, train_command
from bms.presets import Preset, load_preset


def load_pair(
    preset: str | Path | Preset, model: str | Path | KanModel | None
) -> tuple[Preset, KanModel]:
    """Preset and model by name, path or object; without a model the one that ships with it.

    Raises InputError for what cannot be read, and what check_pair raises.
    """
    given = None if isinstance(preset, Preset) else preset
    chosen = preset if isinstance(preset, Preset) else load_preset(preset)
    if isinstance(model, KanModel):
        loaded = model
    else:
        loaded = (
            load_shipped_model(chosen.name, given) if model is None else load_model(Path(model))
        )
    check_pair(chosen, loaded, given)
    return chosen, loaded


def check_pair(preset: Preset, model: KanModel, given: str | Path | None = None) -> None:
    """Raise ModelMismatchError when the model does not belong to the preset.

    `given` is how the user names the preset, for the remedy.

    That is, when it was trained for another cell, uncertainty or box, or has other inputs than the
    firmware's four, with filtered ones behind them.
    """
    names = model.network.input_names
    if names[: len(INPUT_NAMES)] != INPUT_NAMES or len(names) != len(INPUT_NAMES) + len(
        model.network.lags
    ):
        raise ModelMismatchError(
            f"model with inputs {list(model.network.input_names)}: the firmware has "
            f"{list(INPUT_NAMES)} and filtered ones"
        )
    if model.training_hash is not None and model.training_hash != preset.training_hash:
        raise ModelMismatchError(
            f"model {model.hash[:8]} was trained for preset '{model.preset}' with another cell, "
            f"box, sensors, period or limits than preset '{preset.name}' has; train it again with "
            f"{train_command(preset.name, given)} and give it as --model model.json"
        )
