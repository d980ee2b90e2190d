"""A pack on a CAN bus: its ECU, its plant, their frames, and what the bus has room for."""
