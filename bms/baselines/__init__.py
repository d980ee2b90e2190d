"""Charging policies to compare with, behind the controller interface of the firmware."""

from bms.baselines import s_cbf

__all__ = ["s_cbf"]
