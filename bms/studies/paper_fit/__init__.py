"""Fit of cell parameters to the paper's figures: `python -m bms.studies.paper_fit`."""
