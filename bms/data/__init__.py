"""Data sets: simulated charging profiles and measured recordings."""
