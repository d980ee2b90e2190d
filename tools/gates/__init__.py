"""Gates: checks of the C core whose records only get better; see docs/gates.md."""
