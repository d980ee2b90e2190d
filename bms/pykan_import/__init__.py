"""Networks trained with pykan as models of this project."""

from bms.pykan_import.checkpoint import Checkpoint, CheckpointLayer, read_checkpoint
from bms.pykan_import.model import imported_model
from bms.pykan_import.network import imported_network
from bms.pykan_import.pruned import with_all_inputs

__all__ = [
    "Checkpoint",
    "CheckpointLayer",
    "imported_model",
    "imported_network",
    "read_checkpoint",
    "with_all_inputs",
]
