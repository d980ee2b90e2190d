"""What estimate, decision and a control period cost on a microcontroller, in instructions."""

from hil_sim.studies.cost.measure import Cost, CostReport, measure_cost

__all__ = ["Cost", "CostReport", "measure_cost"]
