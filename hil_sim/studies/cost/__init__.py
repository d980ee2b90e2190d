"""What estimate, decision and a control period cost on a microcontroller, in instructions."""

from hil_sim.studies.cost.measure import PARTS, Cost, CostReport, measure_cost

__all__ = ["PARTS", "Cost", "CostReport", "measure_cost"]
