"""What of the simulator is in C, for a host only: the cell, the plant's frames, batches of frames."""
