"""Charges of plants with other physics: do the limits of a family hold where its model does not?"""

from hil_sim.studies.family_plants.charges import ChargeOfPlant, charges_of_plants

__all__ = ["ChargeOfPlant", "charges_of_plants"]
