"""From a preset or recordings to a calibration in flash: steps that are done once and resumed."""
