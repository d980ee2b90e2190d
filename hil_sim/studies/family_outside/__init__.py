"""Cells outside of a preset's family: which limits they cross, and how it ends."""

from hil_sim.studies.family_outside.charges import OUTSIDE, Outcome, charge_outside

__all__ = ["OUTSIDE", "Outcome", "charge_outside"]
