"""How fast each controller charges beside the bound that none can beat, and what it crosses."""
