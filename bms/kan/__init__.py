"""The Kolmogorov-Arnold network that estimates the core temperature, and its training."""

from bms.kan.network import INPUT_NAMES, Edge, Network

__all__ = ["INPUT_NAMES", "Edge", "Network"]
