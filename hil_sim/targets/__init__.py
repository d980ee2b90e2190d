"""Targets that run the firmware outside of this process."""

from hil_sim.targets.flash import Flash
from hil_sim.targets.qemu import Emulation

__all__ = ["Emulation", "Flash"]
