"""Recorded scenarios that the firmware has to answer as it did; `record` makes them."""
