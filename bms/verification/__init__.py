"""Machine-checked argument that decisions keep the barriers until the next one."""

from bms.verification.slips import CLASHING_DELTA4, SLIPS, Formulas, Slip, slips_of
from bms.verification.verify import LARGEST_BOXES, Verification, verify

__all__ = [
    "CLASHING_DELTA4",
    "LARGEST_BOXES",
    "SLIPS",
    "Formulas",
    "Slip",
    "Verification",
    "slips_of",
    "verify",
]
