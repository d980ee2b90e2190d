"""Trained estimators: how they are made, the file that holds one, the preset that it goes with."""

from bms.model.model_file import (
    KanModel,
    load_model,
    load_shipped_model,
    save_model,
    shipped_model_path,
)

__all__ = [
    "KanModel",
    "load_model",
    "load_shipped_model",
    "save_model",
    "shipped_model_path",
]
