"""What gates and long checks have recorded, collected for whoever assesses a product."""

from hil_sim.evidence.collect import Evidence, collect
from hil_sim.evidence.page import archive, numbers, page

__all__ = ["Evidence", "archive", "collect", "numbers", "page"]
