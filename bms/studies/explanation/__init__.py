"""What a trained network has learned: its edge functions, formulas for them, sensitivities."""

from bms.studies.explanation.approximation import Approximation
from bms.studies.explanation.explain import EdgeExplanation, Explanation, Sensitivity, explain

__all__ = ["Approximation", "EdgeExplanation", "Explanation", "Sensitivity", "explain"]
