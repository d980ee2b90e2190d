"""What is asked about the product, not part of it: rival estimators, formulas, the paper's cell."""
