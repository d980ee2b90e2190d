"""Cell parameters from measured temperatures."""

from bms.identification.identify import (
    Identification,
    NotIdentifiedError,
    ParameterEstimate,
    Residuals,
    identify,
)

__all__ = ["Identification", "NotIdentifiedError", "ParameterEstimate", "Residuals", "identify"]
