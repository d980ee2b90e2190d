"""The Kolmogorov-Arnold network that estimates the core temperature, and its training."""

from bms.kan.model_file import (
    KanModel,
    load_model,
    load_shipped_model,
    save_model,
    shipped_model_path,
)
from bms.kan.network import INPUT_NAMES, Edge, Network

__all__ = [
    "INPUT_NAMES",
    "Edge",
    "KanModel",
    "Network",
    "load_model",
    "load_shipped_model",
    "save_model",
    "shipped_model_path",
]
