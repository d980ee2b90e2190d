"""BPX files (Battery Parameter eXchange) as a source of a preset's numbers."""
