"""Battery engineering: cell model, presets, core-temperature estimator, barriers, firmware."""

__version__ = "0.1.0"
