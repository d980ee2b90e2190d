"""Gates: checks of the C core whose records only get better. docs/gates.md tells what each holds."""
