"""Commands of `bms` that run the simulator."""
