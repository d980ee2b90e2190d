"""Cell parameters from measured temperatures."""

from bms.identification.identify import Identification, ParameterEstimate, Residuals, identify

__all__ = ["Identification", "ParameterEstimate", "Residuals", "identify"]
