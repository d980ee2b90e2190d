"""Other estimators of the core temperature, each in float32 C, to compare the KAN with."""
