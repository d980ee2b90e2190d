"""The list of faults with the reaction that each must have, played and judged."""
