"""Packs of cells in series that differ: the weakest governs, beside controllers that see less."""
