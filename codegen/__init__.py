"""From models, presets and the CAN database to C sources; deterministic, without time stamps."""
