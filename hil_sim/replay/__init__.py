"""Recorded frames fed to a firmware again, and its decisions held against others.

Imports no firmware, so that a process can load another build first.
"""
