"""What gates and long checks have recorded, collected for whoever assesses a product.

`kept` is read before the firmware is loaded, so nothing is imported from here.
"""
