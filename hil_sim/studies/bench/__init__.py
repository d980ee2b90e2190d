"""Measures what this project costs and how fast it runs, beside other ways to the same answers."""
