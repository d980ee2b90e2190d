"""What it costs to keep the limits on a whole family of cells: time to full, cause by cause."""

from hil_sim.studies.family_cost.costs import Cost, family_costs

__all__ = ["Cost", "family_costs"]
