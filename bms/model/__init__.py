"""A trained estimator as a file: its provenance, its making, and the preset it belongs to."""

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
