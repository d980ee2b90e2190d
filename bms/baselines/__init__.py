"""Charging policies to compare with, behind the controller interface of the firmware."""

from bms.baselines.s_cbf import SurfaceBarrierController

__all__ = ["SurfaceBarrierController"]
