"""C source of the calibration block: constants of a preset and tables of a model."""

from __future__ import annotations

from bms.calibration import calibration_fields
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.tables import network_tables
from codegen.rendering import environment, initialiser

FILE_NAME = "calibration_default.c"
CALIBRATION_FILE = "calibration.bin"
"""The same constants and tables as a part of a flash image."""
ROUNDING_K = 1e-12


def calibration_source(preset: Preset, model: KanModel) -> dict[str, str]:
    """File name -> text; ModelMismatchError for a stale pair of preset and model."""
    tables = network_tables(model.network)
    text = (
        environment()
        .get_template("calibration.c.j2")
        .render(
            preset=preset,
            model=model,
            table_error_K=f"{tables.error_bound_K:.1e}",
            edge_errors_K=[
                _said(edge.worst_error * model.network.output_half_range_K) for edge in tables.edges
            ],
            initialiser=initialiser(calibration_fields(preset, model)),
        )
    )
    return {FILE_NAME: text}


def _said(error_K: float) -> str:
    """What float64 leaves of an error that is none differs from processor to processor."""
    return f"{error_K:.1e}" if error_K > ROUNDING_K else f"below {ROUNDING_K:.0e}"
