"""The C firmware behind cffi: the estimator, the controller and the whole ECU."""

from bms.firmware.controller import CompiledNetwork, Estimate, Firmware
from bms.firmware.ecu import Ecu
from bms.firmware.reception import Reception, ReceptionCounts

__all__ = ["CompiledNetwork", "Ecu", "Estimate", "Firmware", "Reception", "ReceptionCounts"]
