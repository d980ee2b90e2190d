"""Machine-checked argument that decisions keep the barriers until the next one."""

from bms.verification.slips import CLASHING_DELTA4, SLIPS, Formulas, Slip, slips_of
from bms.verification.verify import ESTIMATE, LARGEST_BOXES, PARTS, Verification, verify

__all__ = [
    "CLASHING_DELTA4",
    "ESTIMATE",
    "LARGEST_BOXES",
    "PARTS",
    "SLIPS",
    "Formulas",
    "Slip",
    "Verification",
    "slips_of",
    "verify",
]
