"""What of the simulator is in C, for a host only: cell, plant's frames, batches of frames."""
