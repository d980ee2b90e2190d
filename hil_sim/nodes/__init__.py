"""The two parties on the bus: the ECU and the plant with its charger."""
